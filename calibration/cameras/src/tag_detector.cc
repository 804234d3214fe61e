#include "semblance/cameras/tag_detector.h"

#include <apriltag/tag36h11.h>

#include <algorithm>

#include "tag_family.h"

namespace semblance {

void TagFamilyDeleter::operator()(apriltag_family_t* family) const { tag36h11_destroy(family); }

TagFamily make_tag_family(int border_bits) {
  TagFamily family(tag36h11_create());
  // The bits move inwards by what the border gains; places are counted from the border's corner.
  const int wider = border_bits - 1;
  family->width_at_border += 2 * wider;
  family->total_width += 2 * wider;
  for (std::uint32_t i = 0; i < family->nbits; ++i) {
    family->bit_x[i] += wider;
    family->bit_y[i] += wider;
  }
  return family;
}

struct TagDetector::Impl {
  struct Deleter {
    void operator()(apriltag_detector_t* detector) const { apriltag_detector_destroy(detector); }
  };

  explicit Impl(const TagSettings& settings)
      : family(make_tag_family(settings.border_bits)), detector(apriltag_detector_create()) {
    apriltag_detector_add_family(detector.get(), family.get());
    detector->quad_decimate = settings.decimate;
    detector->refine_edges = settings.refine_edges;
    detector->nthreads = 1;
  }

  TagFamily family;
  std::unique_ptr<apriltag_detector_t, Deleter> detector;
};

TagDetector::TagDetector(const TagSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
TagDetector::~TagDetector() = default;
TagDetector::TagDetector(TagDetector&&) noexcept = default;

std::vector<FoundTag> TagDetector::detect(const std::uint8_t* grey, int width, int height) {
  if (std::min(width, height) < 32) return {};  // the library's tiles need some room
  // The library only reads the picture, although its type does not say so.
  image_u8_t image{width, height, width, const_cast<std::uint8_t*>(grey)};
  zarray_t* detections = apriltag_detector_detect(impl_->detector.get(), &image);
  std::vector<FoundTag> tags(zarray_size(detections));
  for (std::size_t i = 0; i < tags.size(); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(detections, static_cast<int>(i), &detection);
    tags[i].id = detection->id;
    tags[i].wrong_bits = detection->hamming;
    // libapriltag, like this program, has the first pixel's centre at (0.5, 0.5).
    for (int k = 0; k < 4; ++k) {
      tags[i].corners_px.col(k) = Eigen::Vector2d(detection->p[k][0], detection->p[k][1]);
    }
  }
  apriltag_detections_destroy(detections);
  return tags;
}

}  // namespace semblance
