// Videos are encoded by FFmpeg's libraries themselves: OpenCV's writer offers no choice of the
// encoder's speed, and x264 at its default takes longer for a frame than a tracker has.
extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <new>
#include <string_view>
#include <vector>

#include "opencv_image.h"
#include "semblance/core/atomic_file.h"
#include "semblance/core/errors.h"
#include "semblance/io/video.h"

namespace semblance {
namespace {

/// Owner of an object whose library frees it through a pointer to the pointer.
template <auto release>
struct Release {
  template <typename T>
  void operator()(T* object) const {
    release(&object);
  }
};
struct ReleaseScaler {
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};
struct ReleaseMuxer {
  void operator()(AVFormatContext* muxer) const {
    avio_closep(&muxer->pb);
    avformat_free_context(muxer);
  }
};
using Encoder = std::unique_ptr<AVCodecContext, Release<avcodec_free_context>>;
using Frame = std::unique_ptr<AVFrame, Release<av_frame_free>>;
using Packet = std::unique_ptr<AVPacket, Release<av_packet_free>>;
using Scaler = std::unique_ptr<SwsContext, ReleaseScaler>;
using Muxer = std::unique_ptr<AVFormatContext, ReleaseMuxer>;

/// What is written for a file's extension.
struct Format {
  const char* extension;
  const char* muxer;
  const char* name;       // of the encoding, for messages
  const char* preferred;  // encoder; others of the same encoding are taken where it is missing
  AVCodecID codec;
  AVPixelFormat pixels;
  AVColorRange range;
};

constexpr std::array<Format, 2> formats{{
    {".mp4", "mp4", "H.264", "libx264", AV_CODEC_ID_H264, AV_PIX_FMT_YUV420P, AVCOL_RANGE_MPEG},
    {".avi", "avi", "MJPEG", "mjpeg", AV_CODEC_ID_MJPEG, AV_PIX_FMT_YUVJ420P, AVCOL_RANGE_JPEG},
}};

constexpr double slowest_rate = 0.001, fastest_rate = 10000.0;  // frames per second
/// Bounds of the fraction that holds a rate; 30000/1001 fits.
constexpr int largest_rate_term = 100000;
/// For H.264 encoders that know no constant quality.
constexpr double bits_per_pixel = 0.2;
/// MJPEG's quantiser, of 1 (best) to 31.
constexpr int mjpeg_quantiser = 3;

void silence_ffmpeg() {
  static std::once_flag once;
  std::call_once(once, [] {
    silence_opencv();  // sets the variable, whose level OpenCV gives FFmpeg too
    av_log_set_level(std::atoi(std::getenv("OPENCV_FFMPEG_LOGLEVEL")));
  });
}

const Format& format_of(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  for (const Format& format : formats) {
    if (extension == format.extension) return format;
  }
  throw InvalidInput(path + ": a video is written as .mp4 (H.264) or .avi (MJPG)");
}

[[noreturn]] void fail(const std::string& path, int error) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> reason{};
  av_strerror(error, reason.data(), reason.size());
  throw IoError(fmt::format("{}: cannot write the video: {}", path, reason.data()));
}

template <typename T>
T* allocated(T* object) {
  if (object == nullptr) throw std::bad_alloc();
  return object;
}

Frame make_frame(int width, int height, AVPixelFormat pixels) {
  Frame frame(allocated(av_frame_alloc()));
  frame->width = width;
  frame->height = height;
  frame->format = pixels;
  if (av_frame_get_buffer(frame.get(), 0) < 0) throw std::bad_alloc();
  return frame;
}

bool takes_pixels(const AVCodec& codec, AVPixelFormat pixels) {
  for (const AVPixelFormat* p = codec.pix_fmts; p != nullptr && *p != AV_PIX_FMT_NONE; ++p) {
    if (*p == pixels) return true;
  }
  return false;
}

/// The encoders of a format, the preferred one first.
std::vector<const AVCodec*> encoders_for(const Format& format) {
  std::vector<const AVCodec*> found;
  const AVCodec* preferred = avcodec_find_encoder_by_name(format.preferred);
  if (preferred != nullptr) found.push_back(preferred);
  void* state = nullptr;
  while (const AVCodec* codec = av_codec_iterate(&state)) {
    const bool suits = av_codec_is_encoder(codec) != 0 && codec->id == format.codec;
    if (suits && codec != preferred && takes_pixels(*codec, format.pixels)) found.push_back(codec);
  }
  return found;
}

struct Shape {
  int width = 0, height = 0;  // of the coded picture
  AVRational rate{0, 1};      // frames per second
};

/// Null where the encoder cannot be started, as when it needs a device that is absent.
Encoder open_encoder(const AVCodec& codec, const Format& format, const Shape& shape,
                     bool global_header) {
  Encoder encoder(allocated(avcodec_alloc_context3(&codec)));
  encoder->width = shape.width;
  encoder->height = shape.height;
  encoder->pix_fmt = format.pixels;
  encoder->time_base = av_inv_q(shape.rate);
  encoder->framerate = shape.rate;
  // sRGB in the matrix of BT.601, which is what OpenCV assumes when it reads.
  encoder->color_range = format.range;
  encoder->color_primaries = AVCOL_PRI_BT709;
  encoder->color_trc = AVCOL_TRC_IEC61966_2_1;
  encoder->colorspace = AVCOL_SPC_SMPTE170M;
  encoder->thread_count = 1;  // the trackers need the other cores
  encoder->flags |= AV_CODEC_FLAG_BITEXACT;
  if (global_header) encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  if (format.codec == AV_CODEC_ID_MJPEG) {
    encoder->flags |= AV_CODEC_FLAG_QSCALE;
    encoder->global_quality = mjpeg_quantiser * FF_QP2LAMBDA;
  } else if (std::string_view(codec.name) == "libx264") {
    av_opt_set(encoder->priv_data, "preset", "superfast", 0);
    av_opt_set(encoder->priv_data, "crf", "23", 0);
  } else {
    encoder->bit_rate =
        static_cast<int64_t>(bits_per_pixel * shape.width * shape.height * av_q2d(shape.rate));
  }
  if (avcodec_open2(encoder.get(), &codec, nullptr) < 0) return nullptr;
  return encoder;
}

Encoder start_encoder(const std::string& path, const Format& format, const Shape& shape,
                      bool global_header) {
  for (const AVCodec* codec : encoders_for(format)) {
    if (Encoder encoder = open_encoder(*codec, format, shape, global_header)) return encoder;
  }
  throw IoError(fmt::format(
      "{}: FFmpeg has no {} encoder that can be started for {} x {} pixels at {} frames per "
      "second; a libavcodec with {} is needed",
      path, format.name, shape.width, shape.height, av_q2d(shape.rate), format.preferred));
}

Scaler make_scaler(const Format& format, int width, int height) {
  Scaler scaler(allocated(
      sws_getContext(width, height, AV_PIX_FMT_RGB24, width, height, format.pixels,
                     SWS_BILINEAR | SWS_ACCURATE_RND | SWS_BITEXACT, nullptr, nullptr, nullptr)));
  const int* matrix = sws_getCoefficients(SWS_CS_ITU601);
  const bool full_range = format.range == AVCOL_RANGE_JPEG;
  const int unchanged = 1 << 16;
  sws_setColorspaceDetails(scaler.get(), matrix, 1, matrix, full_range ? 1 : 0, 0, unchanged,
                           unchanged);
  return scaler;
}

int even(int size) { return size + size % 2; }

}  // namespace

struct VideoWriter::Impl {
  Impl(const std::string& path, int width_in, int height_in, double frames_per_second);

  std::string name() const { return file.path().string(); }
  void copy(const Rgb8& picture);
  /// Hands a frame to the encoder (null: there are no more) and writes what it gives back.
  void encode(const AVFrame* frame);
  int check(int result) const {
    if (result < 0) fail(name(), result);
    return result;
  }

  const Format& format;
  AtomicFile file;
  int width = 0, height = 0;
  std::int64_t frames = 0;
  Muxer muxer;
  Encoder encoder;
  Scaler scaler;
  Frame rgb, yuv;
  Packet packet;
};

VideoWriter::Impl::Impl(const std::string& path, int width_in, int height_in,
                        double frames_per_second)
    : format(format_of(path)), file(path), width(width_in), height(height_in) {
  // Chroma is kept at half the resolution, so pictures of odd size are padded.
  const Shape shape{even(width), even(height), av_d2q(frames_per_second, largest_rate_term)};
  AVFormatContext* made = nullptr;
  check(
      avformat_alloc_output_context2(&made, nullptr, format.muxer, file.temporary_path().c_str()));
  muxer.reset(made);
  muxer->flags |= AVFMT_FLAG_BITEXACT;
  const bool global_header = (muxer->oformat->flags & AVFMT_GLOBALHEADER) != 0;
  encoder = start_encoder(path, format, shape, global_header);
  scaler = make_scaler(format, shape.width, shape.height);
  // FFmpeg reads some bytes past the end of a picture, for which its own frames have room.
  rgb = make_frame(shape.width, shape.height, AV_PIX_FMT_RGB24);
  yuv = make_frame(shape.width, shape.height, format.pixels);
  packet.reset(allocated(av_packet_alloc()));
  AVStream* stream = allocated(avformat_new_stream(muxer.get(), nullptr));
  stream->time_base = encoder->time_base;
  stream->avg_frame_rate = shape.rate;
  check(avcodec_parameters_from_context(stream->codecpar, encoder.get()));
  check(avio_open(&muxer->pb, file.temporary_path().c_str(), AVIO_FLAG_WRITE));
  if (format.codec == AV_CODEC_ID_H264) {
    // The index goes to the front, so that browsers play while they load.
    check(av_opt_set(muxer->priv_data, "movflags", "+faststart", 0));
  }
  check(avformat_write_header(muxer.get(), nullptr));
}

void VideoWriter::Impl::copy(const Rgb8& picture) {
  const std::size_t row = static_cast<std::size_t>(width) * 3;
  for (int y = 0; y < rgb->height; ++y) {
    const std::uint8_t* from = picture.data.data() + row * std::min(y, height - 1);
    std::uint8_t* to = rgb->data[0] + static_cast<std::ptrdiff_t>(y) * rgb->linesize[0];
    std::memcpy(to, from, row);
    if (rgb->width > width) std::memcpy(to + row, from + row - 3, 3);
  }
}

void VideoWriter::Impl::encode(const AVFrame* frame) {
  check(avcodec_send_frame(encoder.get(), frame));
  AVStream* stream = muxer->streams[0];
  while (true) {
    const int result = avcodec_receive_packet(encoder.get(), packet.get());
    if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
    check(result);
    packet->duration = 1;
    av_packet_rescale_ts(packet.get(), encoder->time_base, stream->time_base);
    check(av_interleaved_write_frame(muxer.get(), packet.get()));
  }
}

VideoWriter::VideoWriter(const std::string& path, int width, int height, double frames_per_second) {
  silence_ffmpeg();
  check_image_size(path, width, height);
  if (!(frames_per_second >= slowest_rate && frames_per_second <= fastest_rate)) {
    throw InvalidInput(fmt::format("{}: {} frames per second; {} to {} were expected", path,
                                   frames_per_second, slowest_rate, fastest_rate));
  }
  impl_ = std::make_unique<Impl>(path, width, height, frames_per_second);
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::write(const Rgb8& frame) {
  Impl& impl = *impl_;
  const std::size_t values = static_cast<std::size_t>(impl.width) * impl.height * 3;
  if (frame.width != impl.width || frame.height != impl.height || frame.data.size() != values) {
    throw InvalidInput(fmt::format(
        "{}: a frame of {} x {} pixels with {} values was given; {} x {} with {} were expected",
        impl.name(), frame.width, frame.height, frame.data.size(), impl.width, impl.height,
        values));
  }
  impl.copy(frame);
  impl.check(av_frame_make_writable(impl.yuv.get()));  // an encoder may still hold the last one
  impl.check(sws_scale(impl.scaler.get(), impl.rgb->data, impl.rgb->linesize, 0, impl.rgb->height,
                       impl.yuv->data, impl.yuv->linesize));
  impl.yuv->pts = impl.frames++;
  impl.encode(impl.yuv.get());
}

void VideoWriter::close() {
  Impl& impl = *impl_;
  impl.encode(nullptr);
  impl.check(av_write_trailer(impl.muxer.get()));
  impl.check(avio_closep(&impl.muxer->pb));
  impl.file.commit();
}

}  // namespace semblance
