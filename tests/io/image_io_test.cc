#include "semblance/io/image_io.h"

#include <gmock/gmock.h>

#include <cmath>

#include "files.h"
#include "semblance/core/conventions.h"
#include "semblance/core/errors.h"
#include "semblance/core/random.h"
#include "semblance/io/video.h"
#include "support.h"

namespace semblance {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;
using ::testing::ThrowsMessage;
using testing::write_text;

Rgb8 random_image(int width, int height) {
  Random random(5);
  Rgb8 image{width, height,
             std::vector<std::uint8_t>(static_cast<std::size_t>(width) * height * 3)};
  for (std::uint8_t& value : image.data) value = static_cast<std::uint8_t>(random.integer(256));
  return image;
}

TEST(ImageFile, PngKeepsEveryValueAndTheOrderOfChannels) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "image.png";
  const Rgb8 image = random_image(7, 5);
  write_image(path, image);
  EXPECT_EQ(read_image_rgb8(path).data, image.data);
  EXPECT_EQ(rgb8_from_linear(read_image(path)).data, image.data);
  const Image linear = read_image(path);
  EXPECT_FLOAT_EQ(linear.pixel(3, 2)[0], linear_from_srgb(image.data[(2 * 7 + 3) * 3] / 255.0f));
}

TEST(ImageFile, JpegIsCloseOnSmoothPictures) {
  const TemporaryFolder folder;
  const std::string path = folder.path() / "image.JPG";
  Image image(32, 32, 3);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      image.pixel(x, y)[0] = static_cast<float>(x) / 31;
      image.pixel(x, y)[2] = static_cast<float>(y) / 31;
    }
  }
  write_image(path, image);
  const Rgb8 found = read_image_rgb8(path), expected = rgb8_from_linear(image);
  double squares = 0.0;
  for (std::size_t i = 0; i < found.data.size(); ++i) {
    squares +=
        std::pow(found.data[i] - expected.data[i], 2) / static_cast<double>(found.data.size());
  }
  EXPECT_LT(std::sqrt(squares), 6.0);
}

TEST(ImageFile, IsReadFromItsEncodedBytes) {
  const TemporaryFolder folder;
  const Rgb8 image = random_image(4, 4);
  const auto bytes = encode_image(image, ImageFormat::png);
  write_text(folder.path() / "bytes.png", std::string(bytes.begin(), bytes.end()));
  EXPECT_EQ(read_image_rgb8(folder.path() / "bytes.png").data, image.data);
}

TEST(ImageFile, RejectsWhatIsNone) {
  const TemporaryFolder folder;
  write_text(folder.path() / "text.png", "hello");
  write_text(folder.path() / "empty.png", "");
  for (const char* name : {"text.png", "empty.png"}) {
    EXPECT_THAT([&] { read_image(folder.path() / name); },
                ThrowsMessage<InvalidInput>(HasSubstr("not an image")));
  }
  EXPECT_THROW(read_image(folder.path() / "missing.png"), IoError);
  EXPECT_THROW(write_image(folder.path() / "image.bmp", random_image(2, 2)), InvalidInput);
  EXPECT_THROW(write_image(folder.path() / "no/folder.png", random_image(2, 2)), IoError);
  EXPECT_THROW(write_image(folder.path() / "grey.png", Image(2, 2, 1)), InvalidInput);
}

TEST(Rgb8, KeepsAllGreyLevelsThroughLinear) {
  Rgb8 image{256, 1, std::vector<std::uint8_t>(768)};
  for (std::size_t i = 0; i < image.data.size(); ++i)
    image.data[i] = static_cast<std::uint8_t>(i / 3);
  EXPECT_EQ(rgb8_from_linear(linear_from_rgb8(image)).data, image.data);
}

}  // namespace
}  // namespace semblance
