// How a sheet is deformed, as vectors that depend linearly on its vertices.
//
// Every mechanical term of a sheet is a function of one or two vectors d = sum_k c_k x_k: the
// images of the warp's and weft's unit vectors (tension, shear), the second derivatives of the
// embedding (bending; for cloth that hardly stretches their length is the curvature), and the
// chords of Choi and Ko's interlaced springs. The coefficients are constant, so the gradient of an
// energy is D'g and its Hessian D'HD with one sparse matrix D. Quads and triangles differ in D and
// in nothing else.
#pragma once

#include <span>
#include <vector>

#include "semblance/cloth/sheet.h"

namespace semblance {

/// What a row of D measures.
enum class StrainKind {
  warp,        // image of the warp's unit vector, tension
  weft,        // of the weft's
  shear_warp,  // both again, where shear is measured: entry k of one pairs with entry k of the
               // other
  shear_weft,
  bend_warp,  // second derivatives of the embedding, 1/m
  bend_weft,
  twist,
  interlaced,  // chord between vertices two apart over its rest length (Choi and Ko 2002)
};
inline constexpr int strain_kind_count = 8;

/// One entry of a row.
struct StrainEntry {
  int vertex;
  double coefficient;
};

/// The rows of D with the area that each stands for, all rows of a kind in one stretch.
class Deformation {
 public:
  /// Rows without area are left out. `length_m` is the rest length of a chord, else 0.
  void add(StrainKind kind, double area_m2, std::span<const StrainEntry> entries,
           double length_m = 0.0);

  int row_count() const { return static_cast<int>(begin_.size()) - 1; }
  int first(StrainKind kind) const { return first_[static_cast<int>(kind)]; }
  int last(StrainKind kind) const { return first_[static_cast<int>(kind) + 1]; }
  std::span<const StrainEntry> row(int e) const {
    return {entries_.data() + begin_[e], entries_.data() + begin_[e + 1]};
  }
  double area_m2(int e) const { return area_m2_[e]; }
  double length_m(int e) const { return length_m_[e]; }
  Eigen::Vector3d strain(const Points& positions_m, int e) const {
    Eigen::Vector3d d = Eigen::Vector3d::Zero();
    for (const auto& [vertex, coefficient] : row(e)) {
      d += coefficient * positions_m.row(vertex).transpose();
    }
    return d;
  }

 private:
  std::vector<StrainEntry> entries_;
  std::vector<int> begin_{0};
  std::vector<double> area_m2_, length_m_;
  std::array<int, strain_kind_count + 1> first_{};
};

/// How a sheet bends and buckles.
enum class BendingModel {
  curvature,   // second derivatives of the embedding; converges when the mesh is refined
  interlaced,  // Choi and Ko's springs between vertices two apart, as printed; does not
};

/// The rows of a sheet. Quads and triangles whose vertices are all in `fixed` (one flag per vertex,
/// or empty) are held by a clamp: they carry no energy, so that bending begins at the clamp's edge.
Deformation deformation_of(const Sheet& sheet, BendingModel bending,
                           const std::vector<bool>& fixed);

}  // namespace semblance
