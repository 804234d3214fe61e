#include "semblance/io/video.h"

extern "C" {
#include <libavformat/avformat.h>
#include <libavutil/display.h>
}
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <optional>

#include "opencv_image.h"
#include "semblance/core/errors.h"
#include "semblance/io/text.h"

namespace semblance {
namespace {

namespace fs = std::filesystem;

/// A container may count frames that hold nothing to show: this many may be missing.
constexpr int tolerated_missing_frames = 2;

bool is_image_name(const fs::path& path) {
  const std::string extension = text::lower_extension(path.string());
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

/// Where frames come from: one function, false at the end.
class Reader {
 public:
  virtual ~Reader() = default;
  virtual bool read(Rgb8& frame) = 0;
  /// Passes over one frame.
  virtual bool skip() = 0;
};

struct CloseInput {
  void operator()(AVFormatContext* input) const { avformat_close_input(&input); }
};

/// Quarter turns clockwise that show a recording upright, 0 to 3, as its display matrix says.
/// OpenCV 4.6 turns the wrong way (its issue 22088).
int quarter_turns(const std::string& path) {
  AVFormatContext* opened = nullptr;
  if (avformat_open_input(&opened, path.c_str(), nullptr, nullptr) < 0) return 0;
  const std::unique_ptr<AVFormatContext, CloseInput> input(opened);
  const int video = av_find_best_stream(opened, AVMEDIA_TYPE_VIDEO, -1, -1, nullptr, 0);
  if (video < 0) return 0;
  const std::uint8_t* matrix =
      av_stream_get_side_data(opened->streams[video], AV_PKT_DATA_DISPLAYMATRIX, nullptr);
  if (matrix == nullptr) return 0;
  const double degrees = av_display_rotation_get(reinterpret_cast<const std::int32_t*>(matrix));
  if (!std::isfinite(degrees)) return 0;
  const int turns = static_cast<int>(std::lround(-degrees / 90.0)) % 4;
  return (turns + 4) % 4;
}

class FileReader : public Reader {
 public:
  FileReader(const std::string& path, VideoInfo& info) : path_(path) {
    bool opened = false;
    try {
      opened = capture_.open(path, cv::CAP_FFMPEG);
    } catch (const cv::Exception&) {
      opened = false;
    }
    if (!opened) {
      throw InvalidInput(path +
                         ": is not a video that can be decoded; an .mp4, .avi, .mkv or "
                         ".webm file, or a folder of PNG or JPEG images, was expected");
    }
    capture_.set(cv::CAP_PROP_ORIENTATION_AUTO, 0.0);
    turns_ = quarter_turns(path);
    info.width = static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_WIDTH));
    info.height = static_cast<int>(capture_.get(cv::CAP_PROP_FRAME_HEIGHT));
    const double rate = capture_.get(cv::CAP_PROP_FPS);
    info.frames_per_second = std::isfinite(rate) && rate > 0.0 && rate < 1e5 ? rate : 0.0;
    const double count = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    info.frame_count = count > 0.0 && count < 1e9 ? static_cast<int>(count) : 0;
    check_image_size(path, info.width, info.height);
    info_ = &info;
  }

  bool read(Rgb8& frame) override {
    if (!grab()) return false;
    if (!capture_.retrieve(bgr_) || bgr_.empty() || bgr_.type() != CV_8UC3) {
      throw InvalidInput(fmt::format("{}: frame {} cannot be decoded", path_, position_ - 1));
    }
    if (turns_ > 0) {
      constexpr cv::RotateFlags flags[] = {cv::ROTATE_90_CLOCKWISE, cv::ROTATE_180,
                                           cv::ROTATE_90_COUNTERCLOCKWISE};
      cv::rotate(bgr_, upright_, flags[turns_ - 1]);
    }
    rgb8_from_bgr(turns_ > 0 ? upright_ : bgr_, frame);
    return true;
  }

  bool skip() override { return grab(); }

 private:
  bool grab() {
    if (!capture_.grab()) {
      check_complete();
      return false;
    }
    ++position_;
    last_time_s_ = 1e-3 * capture_.get(cv::CAP_PROP_POS_MSEC);
    return true;
  }

  void check_complete() const {
    if (position_ == 0) throw InvalidInput(path_ + ": holds no frame that can be decoded");
    if (position_ + tolerated_missing_frames >= info_->frame_count) return;
    // Some containers count no frames: the number is then duration times rate, too high for a
    // recording that left frames out, but its last frame is at the end all the same.
    if (last_time_s_ * info_->frames_per_second + tolerated_missing_frames + 1 >=
        info_->frame_count) {
      return;
    }
    throw InvalidInput(
        fmt::format("{}: decoding ends after frame {} of {}: the file is damaged or "
                    "cut off. Copy it again, or cut it to its whole part with ffmpeg",
                    path_, position_ - 1, info_->frame_count));
  }

  std::string path_;
  const VideoInfo* info_ = nullptr;
  cv::VideoCapture capture_;
  cv::Mat bgr_, upright_;
  int turns_ = 0;  // quarter turns clockwise that put a frame upright
  int position_ = 0;
  double last_time_s_ = 0.0;
};

class FolderReader : public Reader {
 public:
  FolderReader(const std::string& path, VideoInfo& info) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(path, error)) {
      if (entry.is_regular_file(error) && is_image_name(entry.path())) {
        files_.push_back(entry.path().string());
      }
    }
    if (error) throw IoError(path + ": cannot be listed: " + error.message());
    if (files_.empty()) {
      throw InvalidInput(path +
                         ": the folder has no images; PNG or JPEG files, in the order of "
                         "their names, were expected");
    }
    std::sort(files_.begin(), files_.end());
    Rgb8 first;
    decode(0, first);
    info.width = width_ = first.width;
    info.height = height_ = first.height;
    info.frame_count = static_cast<int>(files_.size());
  }

  bool read(Rgb8& frame) override {
    if (next_ == files_.size()) return false;
    decode(next_++, frame);
    return true;
  }

  bool skip() override {
    if (next_ == files_.size()) return false;
    ++next_;
    return true;
  }

 private:
  void decode(std::size_t index, Rgb8& frame) const {
    const std::string& file = files_[index];
    const cv::Mat bgr = read_bgr(file);
    if (bgr.empty()) {
      throw InvalidInput(
          fmt::format("{}: (frame {}) is not an image that can be decoded", file, index));
    }
    check_image_size(file, bgr.cols, bgr.rows);
    if (width_ != 0 && (bgr.cols != width_ || bgr.rows != height_)) {
      throw InvalidInput(
          fmt::format("{}: (frame {}) has {} x {} pixels, but the first image has "
                      "{} x {}; all must have the same size",
                      file, index, bgr.cols, bgr.rows, width_, height_));
    }
    rgb8_from_bgr(bgr, frame);
  }

  std::vector<std::string> files_;
  std::size_t next_ = 0;
  int width_ = 0, height_ = 0;
};

}  // namespace

struct VideoSource::Impl {
  VideoInfo info;
  std::unique_ptr<Reader> reader;
  std::optional<Rgb8> first;  // decoded when opening, to know that there is one
  int position = 0;
};

VideoSource::VideoSource(const std::string& path) : impl_(std::make_unique<Impl>()) {
  silence_opencv();
  impl_->info.path = path;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw IoError(path + ": cannot be opened: no such file or folder");
  if (fs::is_directory(status)) {
    impl_->reader = std::make_unique<FolderReader>(path, impl_->info);
  } else if (fs::is_regular_file(status)) {
    if (fs::file_size(path, error) == 0) throw InvalidInput(path + ": the file is empty");
    impl_->reader = std::make_unique<FileReader>(path, impl_->info);
  } else {
    throw InvalidInput(path + ": is neither a file nor a folder");
  }
  impl_->first.emplace();
  if (!impl_->reader->read(*impl_->first)) throw InvalidInput(path + ": holds no frame");
  check_image_size(path, impl_->first->width, impl_->first->height);
  // Rotated recordings are delivered upright, whatever the header says of the size.
  impl_->info.width = impl_->first->width;
  impl_->info.height = impl_->first->height;
}

VideoSource::~VideoSource() = default;
VideoSource::VideoSource(VideoSource&&) noexcept = default;

const VideoInfo& VideoSource::info() const { return impl_->info; }

int VideoSource::position() const { return impl_->position; }

bool VideoSource::next(Rgb8& frame) {
  if (impl_->first) {
    frame = std::move(*impl_->first);
    impl_->first.reset();
  } else if (!impl_->reader->read(frame)) {
    return false;
  }
  if (frame.width != impl_->info.width || frame.height != impl_->info.height) {
    throw InvalidInput(fmt::format("{}: frame {} has {} x {} pixels, but the first has {} x {}",
                                   impl_->info.path, impl_->position, frame.width, frame.height,
                                   impl_->info.width, impl_->info.height));
  }
  ++impl_->position;
  return true;
}

void VideoSource::skip_to(int index) {
  if (index < impl_->position) {
    throw InvalidInput(fmt::format("{}: cannot go back from frame {} to {}", impl_->info.path,
                                   impl_->position, index));
  }
  while (impl_->position < index) {
    if (impl_->first) {
      impl_->first.reset();
    } else if (!impl_->reader->skip()) {
      throw InvalidInput(fmt::format("{}: there is no frame {}; the video has {}", impl_->info.path,
                                     index, impl_->position));
    }
    ++impl_->position;
  }
}

}  // namespace semblance
