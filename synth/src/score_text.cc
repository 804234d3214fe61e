#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "semblance/core/rigid3.h"
#include "semblance/synth/score.h"

namespace semblance {
namespace {

using nlohmann::json;

json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }

json to_json(const Spread& spread) {
  return {{"median", number(spread.median)}, {"p95", number(spread.p95)}};
}

json to_json(const Coverage& coverage) {
  return {{"one_sigma", number(coverage.one_sigma)},
          {"two_sigma", number(coverage.two_sigma)},
          {"count", coverage.count}};
}

json to_json(const LandmarkScore& marks) {
  return {{"all_68", to_json(marks.all_68)},
          {"visible_68", to_json(marks.visible_68)},
          {"inner_51", to_json(marks.inner_51)},
          {"corners", to_json(marks.corners)}};
}

json to_json(const ClipScore& clip) {
  return {{"name", clip.name},
          {"frames", clip.frames},
          {"tracked", clip.tracked},
          {"lost", clip.lost},
          {"unflagged", clip.unflagged},
          {"absent", clip.absent},
          {"rotation_deg",
           {{"absolute", to_json(clip.rotation_absolute_deg)},
            {"aligned", to_json(clip.rotation_aligned_deg)},
            {"per_clip", to_json(clip.rotation_per_clip_deg)}}},
          {"translation_percent",
           {{"absolute", to_json(clip.translation_absolute_percent)},
            {"aligned", to_json(clip.translation_aligned_percent)},
            {"per_clip", to_json(clip.translation_per_clip_percent)}}},
          {"landmarks_percent",
           {{"absolute", to_json(clip.landmarks_absolute_percent)},
            {"aligned", to_json(clip.landmarks_aligned_percent)}}},
          {"jitter",
           {{"rotation_deg", number(clip.rotation_jitter_deg)},
            {"translation_mm", number(clip.translation_jitter_mm)},
            {"still_pairs", clip.still_pairs}}},
          {"coverage",
           {{"rotation", to_json(clip.rotation_coverage)},
            {"translation", to_json(clip.translation_coverage)},
            {"parameters", to_json(clip.parameter_coverage)}}}};
}

// "0.42/1.30": median and 95th percentile.
std::string both(const Spread& spread) {
  if (!std::isfinite(spread.median)) return "-";
  return fmt::format("{:.2f}/{:.2f}", spread.median, spread.p95);
}

std::string plain(double value) {
  return std::isfinite(value) ? fmt::format("{:.3f}", value) : "-";
}

std::string row(const ClipScore& clip) {
  return fmt::format(
      "{:<14}{:>7}{:>6}{:>6}  {:>12}{:>12}  {:>12}{:>12}{:>12}  {:>12}{:>12}{:>12}  {:>7}\n",
      clip.name, clip.frames, clip.lost, clip.unflagged, both(clip.rotation_absolute_deg),
      both(clip.rotation_aligned_deg), both(clip.translation_absolute_percent),
      both(clip.translation_aligned_percent), both(clip.translation_per_clip_percent),
      both(clip.landmarks_absolute_percent.all_68), both(clip.landmarks_absolute_percent.inner_51),
      both(clip.landmarks_aligned_percent.all_68), plain(clip.rotation_jitter_deg));
}

}  // namespace

std::string score_json(const SuiteScore& score) {
  const Eigen::Vector3d turn =
      rotation_vector_from_quaternion(score.rotation_offset) * 180 / 3.14159265358979323846;
  json out = {
      {"schema", "semblance.score/1"},
      {"overall", to_json(score.overall)},
      {"removed_by_aligned",
       {{"rotation_deg", {turn.x(), turn.y(), turn.z()}},
        {"origin_m",
         {score.origin_offset_m.x(), score.origin_offset_m.y(), score.origin_offset_m.z()}}}}};
  for (const ClipScore& clip : score.clips) out["clips"].push_back(to_json(clip));
  return out.dump(1);
}

std::string score_table(const SuiteScore& score) {
  std::string text = fmt::format("{:<14}{:>7}{:>6}{:>6}  {:>24}  {:>36}  {:>36}  {:>7}\n", "", "",
                                 "", "", "pose, degrees", "translation, % of distance",
                                 "landmarks, % of eye distance", "jitter");
  text += fmt::format(
      "{:<14}{:>7}{:>6}{:>6}  {:>12}{:>12}  {:>12}{:>12}{:>12}  {:>12}{:>12}{:>12}  {:>7}\n",
      "clip", "frames", "lost", "wrong", "absolute", "aligned", "absolute", "aligned", "per clip",
      "68", "inner 51", "68 aligned", "degrees");
  for (const ClipScore& clip : score.clips) text += row(clip);
  text += row(score.overall);
  const Coverage &turn = score.overall.rotation_coverage,
                 &place = score.overall.translation_coverage;
  if (turn.count > 0)
    text += fmt::format(
        "within 1 / 2 stated sigmas: rotation {:.0f} / {:.0f} %, translation {:.0f} / {:.0f} %"
        " (Gaussian: 68 / 95 %)\n",
        100 * turn.one_sigma, 100 * turn.two_sigma, 100 * place.one_sigma, 100 * place.two_sigma);
  text +=
      "Figures are median/95th percentile over frames. wrong: said to be tracked, but pose off by "
      "more\n"
      "than 10 degrees or landmarks by more than 15 %. aligned: after removing one constant of the "
      "two\n"
      "models over all clips; per clip: its own origin and scale (one camera cannot tell a large "
      "far\n"
      "head from a small near one).\n";
  return text;
}

}  // namespace semblance
