#include "semblance/io/video.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <filesystem>

#include "files.h"
#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

constexpr int frame_count = 40;

/// A smooth picture that tells its number: red falls with it, green and blue are ramps.
Rgb8 frame_picture(int index, int width, int height) {
  Rgb8 frame{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      frame.data.push_back(static_cast<std::uint8_t>(220 - 4 * index));
      frame.data.push_back(static_cast<std::uint8_t>(200 * x / width));
      frame.data.push_back(static_cast<std::uint8_t>(200 * y / height));
    }
  }
  return frame;
}

void write_clip(const std::string& path, int width, int height, double frames_per_second = 25.0) {
  VideoWriter writer(path, width, height, frames_per_second);
  for (int i = 0; i < frame_count; ++i) writer.write(frame_picture(i, width, height));
  writer.close();
}

double rms(const Rgb8& a, const Rgb8& b) {
  double squares = 0.0;
  for (std::size_t i = 0; i < a.data.size(); ++i) squares += std::pow(a.data[i] - b.data[i], 2);
  return std::sqrt(squares / static_cast<double>(a.data.size()));
}

class VideoFiles : public ::testing::TestWithParam<const char*> {};

TEST_P(VideoFiles, SurviveARoundTrip) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / GetParam();
  write_clip(path, 96, 64);
  VideoSource source(path);
  EXPECT_EQ(source.info().width, 96);
  EXPECT_EQ(source.info().height, 64);
  EXPECT_EQ(source.info().frame_count, frame_count);
  EXPECT_NEAR(source.info().frames_per_second, 25.0, 1e-6);
  Rgb8 frame;
  for (int i = 0; i < frame_count; ++i) {
    EXPECT_EQ(source.position(), i);
    ASSERT_TRUE(source.next(frame));
    EXPECT_LT(rms(frame, frame_picture(i, 96, 64)), 4.0) << "frame " << i;
  }
  EXPECT_FALSE(source.next(frame));
}

TEST_P(VideoFiles, KeepColours) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / GetParam();
  // The right matrix and range bring saturated colours back; a neighbour is off by ten and more.
  constexpr std::array<std::array<int, 3>, 6> colours{
      {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}, {0, 0, 0}, {128, 64, 200}}};
  VideoWriter writer(path, 32, 32, 25.0);
  for (const auto& colour : colours) {
    Rgb8 frame{32, 32, {}};
    for (int i = 0; i < 32 * 32; ++i) {
      for (int value : colour) frame.data.push_back(static_cast<std::uint8_t>(value));
    }
    writer.write(frame);
  }
  writer.close();
  VideoSource source(path);
  Rgb8 frame;
  for (const auto& colour : colours) {
    ASSERT_TRUE(source.next(frame));
    for (std::size_t i = 0; i < frame.data.size(); ++i) {
      ASSERT_NEAR(frame.data[i], colour[i % 3], 5) << "frame " << source.position() - 1;
    }
  }
}

TEST_P(VideoFiles, AreTheSameBytesEachTime) {
  const TemporaryFolder folder;
  const std::string first = folder.path() / (std::string("first_") + GetParam());
  const std::string second = folder.path() / (std::string("second_") + GetParam());
  write_clip(first, 96, 64);
  write_clip(second, 96, 64);
  EXPECT_EQ(testing::read_text(first), testing::read_text(second));
}

TEST_P(VideoFiles, KeepTheRateOfBroadcast) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / GetParam();
  write_clip(path, 96, 64, 30000.0 / 1001.0);
  EXPECT_NEAR(VideoSource(path).info().frames_per_second, 30000.0 / 1001.0, 1e-6);
}

TEST_P(VideoFiles, ArePaddedToEvenSizes) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / GetParam();
  write_clip(path, 95, 63);
  VideoSource source(path);
  EXPECT_EQ(source.info().width, 96);
  EXPECT_EQ(source.info().height, 64);
  Rgb8 padded = frame_picture(0, 96, 64);
  const Rgb8 picture = frame_picture(0, 95, 63);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x) {
      for (int c = 0; c < 3; ++c) {
        padded.data[(y * 96 + x) * 3 + c] =
            picture.data[(std::min(y, 62) * 95 + std::min(x, 94)) * 3 + c];
      }
    }
  }
  Rgb8 frame;
  ASSERT_TRUE(source.next(frame));
  EXPECT_LT(rms(frame, padded), 4.0);
}

/// Files of this process may grow to so many bytes for as long as the object lives: a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST_P(VideoFiles, ReportAFullDisk) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / GetParam();
  {
    const FileSizeLimit limit(2000);
    EXPECT_THAT([&] { write_clip(path, 96, 64); },
                ThrowsMessage<IoError>(AllOf(HasSubstr(path), HasSubstr("too large"))));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

INSTANTIATE_TEST_SUITE_P(Kinds, VideoFiles, ::testing::Values("clip.mp4", "clip.avi"),
                         [](const auto& test) { return std::string(test.param).substr(5); });

TEST(VideoWriter, MakesH264ThatBrowsersPlay) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "clip.mp4";
  write_clip(path, 96, 64);
  const std::string bytes = testing::read_text(path);
  // The sample description names H.264; its configuration record follows with the profile: 66, 77
  // and 100 are the 4:2:0 profiles (ISO/IEC 14496-15).
  ASSERT_NE(bytes.find("avc1"), std::string::npos);
  const std::size_t record = bytes.find("avcC");
  ASSERT_NE(record, std::string::npos);
  EXPECT_THAT(static_cast<int>(static_cast<unsigned char>(bytes[record + 5])),
              ::testing::AnyOf(66, 77, 100));
}

TEST(VideoWriter, TellsPlayersTheColoursAndPutsTheIndexFirst) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "clip.mp4";
  write_clip(path, 96, 64);
  const std::string bytes = testing::read_text(path);
  EXPECT_LT(bytes.find("moov"), bytes.find("mdat"));
  // Colour box (ISO/IEC 14496-12, 12.1.5) with the codes of ITU-T H.273: primaries of BT.709 and
  // sRGB 1, transfer of sRGB 13, matrix of BT.601 6; not full range.
  const std::size_t box = bytes.find("colrnclx");
  ASSERT_NE(box, std::string::npos);
  EXPECT_EQ(bytes.substr(box + 8, 7), std::string("\0\x01\0\x0d\0\x06\0", 7));
}

TEST(VideoWriter, LeavesNothingBehindWithoutClose) {
  const TemporaryFolder folder;
  {
    VideoWriter writer(folder.path() / "clip.mp4", 96, 64, 25.0);
    writer.write(frame_picture(0, 96, 64));
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "clip.mp4"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(VideoWriter, RejectsWhatDoesNotFit) {
  const TemporaryFolder folder;
  EXPECT_THROW(VideoWriter(folder.path() / "clip.gif", 96, 64, 25.0), InvalidInput);
  EXPECT_THROW(VideoWriter(folder.path() / "clip.mp4", 0, 64, 25.0), InvalidInput);
  EXPECT_THROW(VideoWriter(folder.path() / "clip.mp4", 96, 64, -1.0), InvalidInput);
  EXPECT_THROW(VideoWriter(folder.path() / "clip.mp4", 96, 64, 1e-9), InvalidInput);
  EXPECT_THROW(VideoWriter(folder.path() / "clip.mp4", 96, 64, std::nan("")), InvalidInput);
  EXPECT_THAT([] { VideoWriter("/no/such/folder/clip.mp4", 96, 64, 25.0); },
              ThrowsMessage<IoError>(HasSubstr("/no/such/folder/clip.mp4")));
  VideoWriter writer(folder.path() / "clip.mp4", 96, 64, 25.0);
  EXPECT_THROW(writer.write(frame_picture(0, 64, 64)), InvalidInput);
  EXPECT_THROW(writer.write(Rgb8{96, 64, {1, 2, 3}}), InvalidInput);
}

TEST(VideoSource, SkipsToTheSameFrames) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "clip.mp4";
  write_clip(path, 96, 64);
  VideoSource whole(path), skipping(path);
  Rgb8 expected, found;
  for (int i = 0; i <= 23; ++i) ASSERT_TRUE(whole.next(expected));
  skipping.skip_to(23);
  EXPECT_EQ(skipping.position(), 23);
  ASSERT_TRUE(skipping.next(found));
  EXPECT_EQ(found.data, expected.data);
  EXPECT_THROW(skipping.skip_to(5), InvalidInput);
  EXPECT_THAT([&] { skipping.skip_to(1000); },
              ThrowsMessage<InvalidInput>(HasSubstr("there is no frame 1000")));
}

void read_all(const std::string& path) {
  VideoSource source(path);
  for (Rgb8 frame; source.next(frame);) {
  }
}

TEST(VideoSource, ReportsACutOffFile) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "clip.avi";
  write_clip(path, 96, 64);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) * 6 / 10);
  EXPECT_THAT([&] { read_all(path); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("clip.avi"), HasSubstr("cut off"))));
}

TEST(VideoSource, RejectsWhatIsNoVideo) {
  const TemporaryFolder folder;
  write_text(folder.path() / "text.mp4", "this is text\n");
  write_text(folder.path() / "empty.mp4", "");
  EXPECT_THAT([&] { VideoSource(folder.path() / "text.mp4"); },
              ThrowsMessage<InvalidInput>(HasSubstr("not a video that can be decoded")));
  EXPECT_THAT([&] { VideoSource(folder.path() / "empty.mp4"); },
              ThrowsMessage<InvalidInput>(HasSubstr("the file is empty")));
  EXPECT_THAT([&] { VideoSource(folder.path() / "missing.mp4"); },
              ThrowsMessage<IoError>(HasSubstr("no such file")));
  // An .mp4 whose index is cut off.
  write_clip(folder.path() / "clip.mp4", 96, 64);
  std::filesystem::resize_file(folder.path() / "clip.mp4", 600);
  EXPECT_THROW(read_all(folder.path() / "clip.mp4"), InvalidInput);
}

TEST(VideoSource, RejectsAVideoWithoutFrames) {
  const TemporaryFolder folder;
  VideoWriter writer(folder.path() / "none.avi", 96, 64, 25.0);
  writer.close();
  EXPECT_THROW(VideoSource(folder.path() / "none.avi"), InvalidInput);
}

TEST(VideoSource, TakesAFolderOfImages) {
  const TemporaryFolder folder;
  for (int i : {2, 0, 1}) {
    write_image(folder.path() / ("image" + std::to_string(i) + ".png"), frame_picture(i, 8, 6));
  }
  write_text(folder.path() / "notes.txt", "not a frame");
  VideoSource source(folder.path());
  EXPECT_EQ(source.info().frame_count, 3);
  Rgb8 frame;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(source.next(frame));
    EXPECT_EQ(frame.data, frame_picture(i, 8, 6).data);
  }
  EXPECT_FALSE(source.next(frame));
}

TEST(VideoSource, RejectsFoldersThatAreNoVideo) {
  const TemporaryFolder folder;
  EXPECT_THAT([&] { VideoSource(folder.path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("has no images")));
  write_image(folder.path() / "a.png", frame_picture(0, 8, 6));
  write_image(folder.path() / "b.png", frame_picture(0, 9, 6));
  EXPECT_THAT([&] { read_all(folder.path()); },
              ThrowsMessage<InvalidInput>(HasSubstr("all must have the same size")));
  write_text(folder.path() / "b.png", "text");
  EXPECT_THAT([&] { read_all(folder.path()); },
              ThrowsMessage<InvalidInput>(AllOf(HasSubstr("b.png"), HasSubstr("frame 1"))));
}

}  // namespace
}  // namespace semblance
