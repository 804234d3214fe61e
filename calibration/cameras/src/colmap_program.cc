#include "semblance/cameras/colmap_program.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>

#include "semblance/core/child_process.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

// Photos under plain names, whatever theirs are: COLMAP's files and messages then need no quotes.
std::map<std::string, std::string> link_photos(const std::vector<std::string>& photos,
                                               const fs::path& folder) {
  fs::create_directories(folder);
  std::map<std::string, std::string> photo_of_link;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const fs::path photo = fs::absolute(photos[i]);
    if (!fs::is_regular_file(photo)) throw InvalidInput(photos[i] + ": no such file");
    const std::string name = fmt::format("{:05}{}", i, photo.extension().string());
    fs::create_symlink(photo, folder / name);
    photo_of_link[name] = photos[i];
  }
  return photo_of_link;
}

// The mapper leaves a numbered folder per part of the photos that hangs together.
ColmapModel largest_model(const fs::path& folder) {
  ColmapModel largest;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (!entry.is_directory()) continue;
    ColmapModel model = read_colmap(entry.path().string());
    if (model.images.size() > largest.images.size()) largest = std::move(model);
  }
  return largest;
}

}  // namespace

ColmapModel reconstruct_with_colmap(const std::vector<std::string>& photos,
                                    const std::string& camera_model, const std::string& workspace,
                                    Progress& progress) {
  const auto program = find_program("colmap");
  if (!program) {
    throw InvalidInput(
        "the program colmap is not installed (apt-get install --no-install-recommends colmap); or "
        "mark points in the photos and give them with --marks");
  }
  if (photos.size() < 3) throw InvalidInput("COLMAP needs three photos at least");
  const fs::path folder(workspace), images = folder / "images", models = folder / "sparse";
  for (const fs::path& stale : {images, models, folder / "database.db", folder / "log.txt"}) {
    fs::remove_all(stale);
  }
  const std::map<std::string, std::string> photo_of_link = link_photos(photos, images);
  fs::create_directories(models);

  const std::string database = (folder / "database.db").string();
  const std::vector<std::vector<std::string>> steps{
      {"feature_extractor", "--database_path", database, "--image_path", images.string(),
       "--ImageReader.camera_model", camera_model, "--ImageReader.single_camera", "1",
       "--SiftExtraction.use_gpu", "0"},
      {"exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"},
      {"mapper", "--database_path", database, "--image_path", images.string(), "--output_path",
       models.string(), "--Mapper.min_model_size", "3"}};
  progress.begin("COLMAP", static_cast<std::int64_t>(steps.size()));
  std::int64_t done = 0;
  for (const std::vector<std::string>& step : steps) {
    const int status =
        run_program(*program, step, folder / "log.txt", [&] { return progress.cancelled(); });
    if (progress.cancelled()) throw SolverError("COLMAP was interrupted");
    if (status != 0) {
      throw SolverError(fmt::format("colmap {} ended with {}; see {}", step[0], status,
                                    (folder / "log.txt").string()));
    }
    progress.update(++done);
  }
  progress.end();

  ColmapModel model = largest_model(models);
  if (model.images.empty()) {
    throw SolverError(fmt::format(
        "COLMAP found no model: photos must overlap, be sharp, and show structure from different "
        "places; see {}",
        (folder / "log.txt").string()));
  }
  for (auto& [id, image] : model.images) image.name = photo_of_link.at(image.name);
  return model;
}

}  // namespace semblance
