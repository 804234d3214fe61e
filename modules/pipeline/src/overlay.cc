#include "semblance/pipeline/overlay.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "semblance/core/conventions.h"
#include "semblance/core/errors.h"
#include "semblance/pipeline/background_queue.h"
#include "semblance/render/visibility.h"
#include "thin_wire.h"

namespace semblance {
namespace {

// Pictures are RGB, so scalars are (red, green, blue).
const cv::Scalar k_wire{140, 225, 255}, k_feature{255, 214, 70}, k_dark{16, 18, 22};
const cv::Scalar k_text{240, 240, 240}, k_faint_text{178, 182, 188};
const cv::Scalar k_tracked{46, 160, 67}, k_lost{214, 40, 40}, k_reinitialised{230, 140, 0};
constexpr int k_wire_vertices = 450;
constexpr int k_subpixel_bits = 4;  // cv's fixed-point drawing coordinates
constexpr int k_readable_width = 640;
constexpr std::size_t k_waiting_frames = 8;
constexpr int k_depth_width = 480;             // of the picture that decides what is hidden
constexpr double k_depth_tolerance_m = 0.003;  // chosen vertices lie between that picture's pixels

/// Chains of the 68 landmarks of the iBUG scheme: first, last, closed.
struct Chain {
  int first, last;
  bool closed;
};
constexpr std::array<Chain, 9> k_ibug68{{{0, 16, false},
                                         {17, 21, false},
                                         {22, 26, false},
                                         {27, 30, false},
                                         {31, 35, false},
                                         {36, 41, true},
                                         {42, 47, true},
                                         {48, 59, true},
                                         {60, 67, true}}};

/// Fixed-point place for cv's drawing, from our pixel coordinates.
cv::Point fixed_point(const Eigen::Vector2d& point_px) {
  const Eigen::Vector2d p = integer_centred_from_ours(point_px) * (1 << k_subpixel_bits);
  return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
}

/// Finite and near enough to the picture for fixed-point coordinates.
bool drawable(const Eigen::Vector2d& point_px) {
  return point_px.allFinite() && point_px.cwiseAbs().maxCoeff() < 20000.0;
}

void draw_line(cv::Mat& picture, const Eigen::Vector2d& a_px, const Eigen::Vector2d& b_px,
               const cv::Scalar& colour, int thickness) {
  if (drawable(a_px) && drawable(b_px))
    cv::line(picture, fixed_point(a_px), fixed_point(b_px), colour, thickness, cv::LINE_AA,
             k_subpixel_bits);
}

void draw_text(cv::Mat& picture, const std::string& text, cv::Point baseline_left, double size,
               const cv::Scalar& colour, int thickness = 1) {
  cv::putText(picture, text, baseline_left, cv::FONT_HERSHEY_SIMPLEX, size, colour, thickness,
              cv::LINE_AA);
}

int text_width(const std::string& text, double size, int thickness = 1) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, thickness, &baseline).width;
}

/// picture += coverage * (colour - picture), coverage of 255 being `opacity`.
void blend(cv::Mat& picture, const cv::Mat& coverage, const cv::Scalar& colour, double opacity) {
  const std::array<int, 3> target{static_cast<int>(colour[0]), static_cast<int>(colour[1]),
                                  static_cast<int>(colour[2])};
  const int scale = static_cast<int>(std::lround(opacity * 65536.0 / 255.0));
  for (int y = 0; y < picture.rows; ++y) {
    std::uint8_t* out = picture.ptr<std::uint8_t>(y);
    const std::uint8_t* in = coverage.ptr<std::uint8_t>(y);
    for (int x = 0; x < picture.cols; ++x, out += 3) {
      if (in[x] == 0) continue;
      const int weight = in[x] * scale;
      for (int k = 0; k < 3; ++k)
        out[k] = static_cast<std::uint8_t>(out[k] + (((target[k] - out[k]) * weight) >> 16));
    }
  }
}

/// Darkens a rectangle for text to stand on.
void shade(cv::Mat& picture, const cv::Rect& rectangle) {
  cv::Mat part = picture(rectangle);
  cv::addWeighted(part, 0.3, cv::Mat(part.size(), CV_8UC3, k_dark), 0.7, 0.0, part);
}

cv::Scalar status_colour(TrackStatus status) {
  switch (status) {
    case TrackStatus::tracked:
      return k_tracked;
    case TrackStatus::reinitialised:
      return k_reinitialised;
    case TrackStatus::lost:
      break;
  }
  return k_lost;
}

std::string status_word(TrackStatus status) {
  switch (status) {
    case TrackStatus::tracked:
      return "TRACKED";
    case TrackStatus::reinitialised:
      return "REINITIALISED";
    case TrackStatus::lost:
      break;
  }
  return "LOST";
}

template <class... Values>
std::string formatted(const char* format, Values... values) {
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

void draw_banner(cv::Mat& picture, const TrackFrame& track, const std::string& figures,
                 double unit) {
  const double size = 0.52 * unit;
  const int height = static_cast<int>(std::lround(30.0 * unit));
  const int pad = static_cast<int>(std::lround(10.0 * unit));
  const int top = picture.rows - height;
  shade(picture, {0, top, picture.cols, height});

  const int baseline = top + static_cast<int>(std::lround(20.0 * unit));
  const std::string word = status_word(track.status);
  const int badge = text_width(word, size) + 2 * pad;
  cv::rectangle(picture, cv::Rect(0, top, badge, height), status_colour(track.status), cv::FILLED);
  draw_text(picture, word, {pad, baseline}, size, {255, 255, 255});
  draw_text(picture, formatted("frame %d   %.2f s", track.frame, track.time_s),
            {badge + pad, baseline}, size, k_text);
  if (track.status == TrackStatus::lost) return;
  draw_text(picture, figures, {picture.cols - text_width(figures, size) - pad, baseline}, size,
            k_faint_text);
}

/// Grey picture, thick red border, and the word.
void draw_lost(cv::Mat& picture, double unit) {
  cv::Mat grey;
  cv::cvtColor(picture, grey, cv::COLOR_RGB2GRAY);
  cv::cvtColor(grey * 0.6, picture, cv::COLOR_GRAY2RGB);
  const int border = static_cast<int>(std::lround(8.0 * unit));
  cv::rectangle(picture, cv::Rect(0, 0, picture.cols, picture.rows), k_lost, 2 * border);
  const double size = 2.2 * unit;
  const int thickness = std::max(2, static_cast<int>(std::lround(4.0 * unit)));
  const int left = (picture.cols - text_width("LOST", size, thickness)) / 2;
  draw_text(picture, "LOST", {left, static_cast<int>(std::lround(80.0 * unit))}, size, k_lost,
            thickness);
}

/// Tells which points of a scene are in front, on a reduced picture without lens distortion.
class FrontTest {
 public:
  explicit FrontTest(const Camera& camera)
      : camera_(camera.without_distortion().scaled(
            std::min(1.0, k_depth_width / double(camera.width)))) {}

  void prepare(const Scene& scene) {
    rasteriser_.visible_pixels(scene, camera_, nullptr, seen_);
    depth_m_.assign(static_cast<std::size_t>(camera_.width) * camera_.height, k_nothing);
    for (std::size_t i = 0; i < seen_.size(); ++i)
      depth_m_[static_cast<std::size_t>(seen_.pixel[i])] = seen_.depth_m[i];
  }

  /// Whether some pixel next to the point's place sees no surface nearer than the point.
  bool in_front(const Eigen::Vector3d& point_world_m) const {
    const Eigen::Vector3d p = camera_.camera_from_world * point_world_m;
    if (p.z() <= 0.0) return false;
    const Eigen::Vector2d px = project(camera_, p);
    if (!drawable(px)) return false;
    const int x = static_cast<int>(std::floor(px.x())), y = static_cast<int>(std::floor(px.y()));
    for (int v = std::max(0, y - 1); v <= std::min(camera_.height - 1, y + 1); ++v)
      for (int u = std::max(0, x - 1); u <= std::min(camera_.width - 1, x + 1); ++u)
        if (depth_m_[static_cast<std::size_t>(v) * camera_.width + u] > p.z() - k_depth_tolerance_m)
          return true;
    return false;
  }

 private:
  static constexpr float k_nothing = std::numeric_limits<float>::infinity();
  Camera camera_;
  Rasteriser rasteriser_;
  VisiblePixels seen_;
  std::vector<float> depth_m_;
};

}  // namespace

int overlay_scale(int source_width) {
  return source_width >= k_readable_width
             ? 1
             : (k_readable_width + source_width - 1) / std::max(1, source_width);
}

double overlay_unit(int picture_width) { return std::clamp(picture_width / 800.0, 0.8, 3.0); }

void paint_status(Rgb8& picture, const TrackFrame& track, const std::string& figures) {
  cv::Mat view(picture.height, picture.width, CV_8UC3, picture.data.data());
  const double unit = overlay_unit(picture.width);
  if (track.status == TrackStatus::lost) draw_lost(view, unit);
  draw_banner(view, track, figures, unit);
}

struct OverlayPainter::Impl {
  Camera source_camera, camera;  // as given, and of the enlarged picture
  double unit = 1.0;             // size of text and marks
  std::map<std::shared_ptr<const Mesh>, ThinWire> wires;
  FrontTest front;
  cv::Mat coverage;

  explicit Impl(const Camera& given)
      : source_camera(given),
        camera(given.scaled(overlay_scale(given.width))),
        unit(overlay_unit(camera.width)),
        front(given) {}

  const ThinWire& wire_of(const std::shared_ptr<const Mesh>& mesh) {
    const auto found = wires.find(mesh);
    if (found != wires.end()) return found->second;
    return wires.emplace(mesh, thin_wire(*mesh, k_wire_vertices)).first->second;
  }

  void draw_wire(cv::Mat& picture, const SceneObject& object) {
    const ThinWire& wire = wire_of(object.mesh);
    const Eigen::Vector3d eye_m = camera.camera_from_world.inverse().translation_m;
    std::vector<Eigen::Vector2d> pixels(wire.vertices.size());
    std::vector<double> strength(wire.vertices.size(), 0.0);
    for (std::size_t i = 0; i < wire.vertices.size(); ++i) {
      const Eigen::Vector3d p = object.positions_m.row(wire.vertices[i]).cast<double>();
      const Eigen::Vector3d n = object.normals.row(wire.vertices[i]).cast<double>();
      if (!front.in_front(p)) continue;
      // Lines fade where the surface turns away, before they pile up at the outline.
      strength[i] = std::clamp(3.0 * n.dot((eye_m - p).normalized()), 0.0, 1.0);
      pixels[i] = project_world(camera, p);
    }
    coverage.create(picture.rows, picture.cols, CV_8UC1);
    coverage.setTo(0);
    Eigen::AlignedBox2d drawn;
    for (const auto& [a, b] : wire.edges) {
      const double both = std::min(strength[a], strength[b]);
      if (both <= 0.0) continue;
      draw_line(coverage, pixels[a], pixels[b], cv::Scalar(255.0 * both), 1);
      drawn.extend(pixels[a]).extend(pixels[b]);
    }
    if (drawn.isEmpty()) return;
    const Eigen::Vector2d low = drawn.min().array() - 2.0, size = drawn.sizes().array() + 4.0;
    const cv::Rect part = cv::Rect(static_cast<int>(low.x()), static_cast<int>(low.y()),
                                   static_cast<int>(size.x()) + 1, static_cast<int>(size.y()) + 1) &
                          cv::Rect(0, 0, picture.cols, picture.rows);
    cv::Mat under = picture(part);
    blend(under, coverage(part), k_wire, 0.5);
  }

  void draw_landmarks(cv::Mat& picture, const TrackFrame& track) const {
    std::vector<Eigen::Vector2d> points;
    for (const Eigen::Vector2d& p : track.landmarks_px)
      points.push_back(p * overlay_scale(source_camera.width));
    if (points.size() == 68) {
      for (const Chain& chain : k_ibug68) {
        for (int i = chain.first; i < chain.last; ++i)
          draw_line(picture, points[i], points[i + 1], k_feature, 1);
        if (chain.closed) draw_line(picture, points[chain.last], points[chain.first], k_feature, 1);
      }
    }
    const int radius = static_cast<int>(std::lround(1.7 * unit * (1 << k_subpixel_bits)));
    for (const Eigen::Vector2d& p : points)
      if (drawable(p))
        cv::circle(picture, fixed_point(p), radius, k_feature, cv::FILLED, cv::LINE_AA,
                   k_subpixel_bits);
  }

  void draw_axes(cv::Mat& picture, const TrackFrame& track) const {
    const Eigen::Vector4d& q = track.rotation_wxyz;
    const Rigid3 world_from_head{Eigen::Quaterniond(q[0], q[1], q[2], q[3]), track.translation_m};
    const Rigid3 camera_from_head = camera.camera_from_world * world_from_head;
    const std::array<Eigen::Vector3d, 3> ends{
        Eigen::Vector3d(0.025, 0, 0), Eigen::Vector3d(0, 0.025, 0), Eigen::Vector3d(0, 0, 0.08)};
    const std::array<cv::Scalar, 3> colours{cv::Scalar(235, 64, 52), cv::Scalar(60, 200, 80),
                                            cv::Scalar(60, 120, 255)};
    if (camera_from_head.translation_m.z() <= 0.0) return;
    const Eigen::Vector2d origin = project(camera, camera_from_head.translation_m);
    const int thickness = std::max(1, static_cast<int>(std::lround(2.0 * unit)));
    for (std::size_t axis = 0; axis < ends.size(); ++axis) {
      const Eigen::Vector3d end_m = camera_from_head * ends[axis];
      if (end_m.z() <= 0.0) continue;
      draw_line(picture, origin, project(camera, end_m), k_dark, thickness + 2);
      draw_line(picture, origin, project(camera, end_m), colours[axis], thickness);
    }
  }

  Rgb8 paint(const Rgb8& source, const Scene& scene, const TrackFrame& track) {
    if (source.width != source_camera.width || source.height != source_camera.height)
      throw InvalidInput(
          formatted("overlay: the frame has %d x %d pixels", source.width, source.height) +
          formatted(" and the camera %d x %d; use the camera of this video", source_camera.width,
                    source_camera.height));
    const cv::Mat in(source.height, source.width, CV_8UC3,
                     const_cast<std::uint8_t*>(source.data.data()));
    Rgb8 out{camera.width, camera.height, {}};
    out.data.resize(static_cast<std::size_t>(out.width) * out.height * 3);
    cv::Mat picture(out.height, out.width, CV_8UC3, out.data.data());
    cv::resize(in, picture, picture.size(), 0, 0, cv::INTER_LINEAR);

    if (track.status != TrackStatus::lost) {
      front.prepare(scene);
      for (const SceneObject& object : scene.objects) draw_wire(picture, object);
      draw_landmarks(picture, track);
      draw_axes(picture, track);
    }
    paint_status(out, track,
                 formatted("residual %.4f   inliers %.0f %%", track.residual_rms,
                           100 * track.inlier_fraction));
    return out;
  }
};

OverlayPainter::OverlayPainter(const Camera& camera) : impl_(std::make_unique<Impl>(camera)) {}
OverlayPainter::~OverlayPainter() = default;
OverlayPainter::OverlayPainter(OverlayPainter&&) noexcept = default;

int OverlayPainter::width() const { return impl_->camera.width; }
int OverlayPainter::height() const { return impl_->camera.height; }
Rgb8 OverlayPainter::paint(const Rgb8& source, const Scene& scene, const TrackFrame& track) {
  return impl_->paint(source, scene, track);
}

namespace {

struct OverlayJob {
  Rgb8 source;
  Scene scene;
  TrackFrame track;
};

}  // namespace

struct OverlayWriter::Impl {
  OverlayPainter painter;
  VideoWriter video;
  Painted painted;
  BackgroundQueue<OverlayJob> queue;  // last: its thread uses the others

  Impl(const std::string& path, const Camera& camera, double frames_per_second, Painted sink)
      : painter(camera),
        video(path, painter.width(), painter.height(), frames_per_second),
        painted(std::move(sink)),
        queue(k_waiting_frames, [this](OverlayJob& job) {
          const Rgb8 picture = painter.paint(job.source, job.scene, job.track);
          if (painted) painted(picture, job.track);
          video.write(picture);
        }) {}
};

OverlayWriter::OverlayWriter(const std::string& path, const Camera& camera,
                             double frames_per_second, Painted painted)
    : impl_(std::make_unique<Impl>(path, camera, frames_per_second, std::move(painted))) {}
OverlayWriter::~OverlayWriter() = default;
OverlayWriter::OverlayWriter(OverlayWriter&&) noexcept = default;

void OverlayWriter::write(Rgb8 source, const Scene& scene, TrackFrame track) {
  OverlayJob job{std::move(source), {}, std::move(track)};
  if (job.track.status != TrackStatus::lost) job.scene = scene;
  impl_->queue.push(std::move(job));
}

void OverlayWriter::close() {
  impl_->queue.finish();
  impl_->video.close();
}

}  // namespace semblance
