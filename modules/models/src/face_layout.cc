// Vertices, triangles, charts and parts of the built-in face.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "face_sweep.h"

namespace semblance::face {
namespace {

constexpr double pi = std::numbers::pi;

// Columns between feature columns and rows between feature lines at density 1.
constexpr std::array<int, column_count - 1> column_steps = {2, 4, 3, 3, 4, 5, 4, 3, 4, 3, 3, 3};
constexpr std::array<int, line_count - 1> row_steps = {7, 4, 4, 3, 4, 0, 4, 3, 3, 4,
                                                       6, 3, 5, 0, 4, 2, 3, 3, 3, 3};
// Width on the texture of the space between feature columns, and height between feature lines.
constexpr std::array<double, column_count - 1> column_texels = {5,  8,  7,  8,  10, 12,
                                                                14, 14, 14, 11, 14, 14};
constexpr std::array<double, line_count - 1> row_texels = {30, 22, 9, 8, 8,  3, 11, 9,  9, 9,
                                                           8,  12, 9, 8, 10, 9, 12, 11, 9, 20};
constexpr double skin_bottom = 0.22;  // of the skin's chart; the other charts lie below

std::vector<double> subdivided(const int* steps, int count, double density) {
  std::vector<double> coordinates{0.0};
  for (int i = 0; i < count; ++i) {
    const int n =
        steps[i] == 0 ? 1 : std::max(1, static_cast<int>(std::lround(steps[i] * density)));
    for (int k = 1; k <= n; ++k) coordinates.push_back(i + static_cast<double>(k) / n);
  }
  return coordinates;
}

template <std::size_t N>
double along(const std::array<double, N>& widths, double coordinate) {
  double total = 0.0, here = 0.0;
  for (std::size_t i = 0; i < N; ++i) {
    total += widths[i];
    here += widths[i] * std::clamp(coordinate - static_cast<double>(i), 0.0, 1.0);
  }
  return here / total;
}

class Builder {
 public:
  explicit Builder(double density) : density_(density) {}

  Layout build() {
    skin();
    for (double side : {-1.0, 1.0}) eyeball(side);
    teeth(Patch::upper_teeth, 0.115f);
    teeth(Patch::lower_teeth, 0.015f);
    for (double side : {-1.0, 1.0}) ear(side);
    return std::move(layout_);
  }

 private:
  int add(const Place& place, double u, double v, FacePart part) {
    layout_.places.push_back(place);
    layout_.uvs.emplace_back(static_cast<float>(u), static_cast<float>(v));
    layout_.part.push_back(static_cast<std::uint8_t>(part));
    return static_cast<int>(layout_.places.size()) - 1;
  }
  void triangle(int a, int b, int c) {
    if (a != b && b != c && c != a) layout_.triangles.emplace_back(a, b, c);
  }
  // Corners a b above c d, seen from outside.
  void quad(int a, int b, int c, int d) {
    triangle(a, c, d);
    triangle(a, d, b);
  }
  // The same between columns k and k + 1 of two rows; the halves' diagonals mirror one another.
  void skin_quad(const std::vector<int>& above, const std::vector<int>& below, std::size_t k) {
    if (columns_[k] < 0.0) {
      quad(above[k], above[k + 1], below[k], below[k + 1]);
    } else {
      triangle(above[k], below[k], above[k + 1]);
      triangle(above[k + 1], below[k], below[k + 1]);
    }
  }
  int steps(int at_density_one, int least) const {
    return std::max(least, static_cast<int>(std::lround(at_density_one * density_)));
  }

  double u_of(double column, double side) const {
    return 0.5 + side * 0.495 * along(column_texels, column);
  }
  double v_of(double row) const {
    return 1.0 - 0.005 - (0.99 - skin_bottom) * along(row_texels, row);
  }

  static bool in_slit(double row_line, double column) {
    if (row_line == line_lower_lid) return column > column_inner_eye && column < column_outer_eye;
    return row_line == line_lower_contact && column < column_mouth_corner;
  }

  void skin() {
    const std::vector<double> half =
        subdivided(column_steps.data(), static_cast<int>(column_steps.size()), density_);
    for (std::size_t i = half.size(); i-- > 0;) columns_.push_back(-half[i]);
    columns_.insert(columns_.end(), half.begin() + 1, half.end());
    const std::vector<double> rows =
        subdivided(row_steps.data(), static_cast<int>(row_steps.size()), density_);
    std::vector<int> above;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      std::vector<int> ids = skin_row(rows[r], above);
      const bool slit = rows[r] == line_lower_lid || rows[r] == line_lower_contact;
      if (slit) {
        linings(rows[r] == line_lower_lid, above, ids);
      } else if (r > 0) {
        for (std::size_t k = 0; k + 1 < ids.size(); ++k) {
          if (r == 1) {
            triangle(above[k], ids[k], ids[k + 1]);
          } else {
            skin_quad(above, ids, k);
          }
        }
      }
      above = std::move(ids);
    }
  }

  std::vector<int> skin_row(double row, const std::vector<int>& above) {
    const bool slit = row == line_lower_lid || row == line_lower_contact;
    std::vector<int> ids;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      const double column = std::abs(columns_[k]);
      if (slit && !in_slit(row, column)) {
        ids.push_back(above[k]);
        continue;
      }
      const double side = columns_[k] < 0.0 ? -1.0 : columns_[k] > 0.0 ? 1.0 : 0.0;
      const double edge = columns_[k] < 0.0 ? -1.0 : 1.0;
      ids.push_back(add({Patch::skin, side, column, row}, u_of(column, edge), v_of(row),
                        skin_part(column, row)));
    }
    return ids;
  }

  static FacePart skin_part(double column, double row) {
    const double to_corner = column / column_mouth_corner;
    const double taper = 0.05 + 0.8 * std::pow(to_corner, 8);
    if (to_corner <= 1.0 && row >= line_upper_vermilion + taper &&
        row <= line_lower_vermilion - taper) {
      return FacePart::lips;
    }
    if (row > line_jaw + 0.5) return FacePart::neck;
    const double hairline = column < column_zygion ? line_trichion
                            : column < column_ear  ? line_trichion + 1.5 * (column - column_zygion)
                            : column < column_behind_ear
                                ? line_trichion + 1.5 + 7.0 * (column - column_ear)
                                : line_ala_top + 0.5;
    if (row < hairline) return FacePart::hair;
    // The brow tapers outwards.
    const double inner = column_nostril, outer = column_outer_eye + 0.3;
    const double along_brow = (column - inner) / (outer - inner);
    const double half_width = 0.28 - 0.14 * along_brow * along_brow;
    if (along_brow > 0.0 && along_brow < 1.0 &&
        std::abs(row - (line_brow_top + 0.42)) < half_width) {
      return FacePart::brow;
    }
    if (row > line_tip_low + 0.15 && row < line_tip_low + 0.75 && column > column_philtrum + 0.1 &&
        column < column_nostril - 0.2) {
      return FacePart::nostril;
    }
    if (column > column_inner_eye && column < column_outer_eye &&
        (row == line_upper_lid || (row < line_upper_lid && row > line_upper_lid - 0.01))) {
      return FacePart::lashes;
    }
    return FacePart::skin;
  }

  // Sheets behind a slit: from the upper edge inwards and back to the lower edge.
  void linings(bool eye, const std::vector<int>& upper, const std::vector<int>& lower) {
    const int depth = eye ? 2 : 4;
    const double line = eye ? line_upper_lid : line_upper_contact;
    std::vector<std::vector<int>> sheets{upper};
    for (int i = 1; i <= 2 * depth; ++i) {
      const bool top = i <= depth;
      std::vector<int> sheet = upper;
      for (std::size_t k = 0; k < columns_.size(); ++k) {
        const double column = std::abs(columns_[k]);
        if (!in_slit(line + 1, column)) continue;
        Place place;
        place.patch = eye ? (top ? Patch::upper_lid_inside : Patch::lower_lid_inside)
                          : (top ? Patch::upper_lip_inside : Patch::lower_lip_inside);
        place.side = columns_[k] < 0.0 ? -1.0 : columns_[k] > 0.0 ? 1.0 : 0.0;
        place.column = column;
        place.depth = top ? i : 2 * depth + 1 - i;
        const double v = v_of(line + static_cast<double>(i) / (2 * depth + 1));
        const FacePart part = eye                ? FacePart::other
                              : place.depth == 1 ? FacePart::lips
                                                 : FacePart::mouth_cavity;
        sheet[k] = add(place, u_of(column, columns_[k] < 0.0 ? -1.0 : 1.0), v, part);
      }
      sheets.push_back(std::move(sheet));
    }
    sheets.push_back(lower);
    for (std::size_t i = 0; i + 1 < sheets.size(); ++i) {
      for (std::size_t k = 0; k + 1 < columns_.size(); ++k) {
        skin_quad(sheets[i], sheets[i + 1], k);
      }
    }
  }

  void eyeball(double side) {
    // Angles from the optical axis in units of the iris' edge, then on to the back.
    static constexpr std::array<double, 12> rings = {5.0, 8.6, 9.6, 18, 28.4, 30.2,
                                                     40,  52,  66,  84, 110,  145};
    const int around = steps(18, 12);
    const double cu = side < 0.0 ? 0.11 : 0.32, cv = 0.108, radius = 0.1;
    const auto vertex = [&](double ring_deg, double b) {
      const FacePart part = ring_deg < 9.0    ? FacePart::pupil
                            : ring_deg < 29.2 ? FacePart::iris
                                              : FacePart::sclera;
      const double rho = radius * std::sqrt(ring_deg / 180.0);
      Place place{Patch::eyeball, side};
      place.a = ring_deg * pi / 180.0;
      place.b = b;
      return add(place, cu + rho * std::cos(b), cv + rho * std::sin(b), part);
    };
    const int front = vertex(0.0, 0.0);
    std::vector<int> inner;
    for (double ring : rings) {
      std::vector<int> outer;
      for (int k = 0; k < around; ++k) outer.push_back(vertex(ring, 2.0 * pi * k / around));
      for (int k = 0; k < around; ++k) {
        const int n = (k + 1) % around;
        // The right eye mirrors the left, and its angle turns the other way.
        const int a = side > 0.0 ? k : n, b = side > 0.0 ? n : k;
        if (inner.empty()) {
          triangle(front, outer[a], outer[b]);
        } else {
          quad(inner[a], inner[b], outer[a], outer[b]);
        }
      }
      inner = std::move(outer);
    }
    // The pole at the back is unrolled to the chart's rim.
    for (int k = 0; k < around; ++k) {
      const int n = (k + 1) % around;
      const int pole = vertex(180.0, 2.0 * pi * (k + 0.5) / around);
      triangle(inner[side > 0.0 ? k : n], pole, inner[side > 0.0 ? n : k]);
    }
  }

  void teeth(Patch patch, float v0) {
    const int along_arch = steps(28, 14);
    constexpr int stations = 5;
    std::vector<int> before;
    for (int k = 0; k <= along_arch; ++k) {
      std::vector<int> now;
      for (int b = 0; b < stations; ++b) {
        Place place{patch};
        place.a = -1.0 + 2.0 * k / along_arch;
        place.side = place.a < 0.0 ? -1.0 : place.a > 0.0 ? 1.0 : 0.0;
        place.b = b;
        now.push_back(add(place, 0.86 + 0.13 * k / along_arch, v0 + 0.085 * b / (stations - 1),
                          FacePart::teeth));
      }
      for (int b = 0; b + 1 < stations && k > 0; ++b) {
        const bool upper = patch == Patch::upper_teeth;
        // Stations run from the gum over the front to the edge and up the back.
        if (upper) {
          quad(before[b], now[b], before[b + 1], now[b + 1]);
        } else {
          quad(now[b], before[b], now[b + 1], before[b + 1]);
        }
      }
      before = std::move(now);
    }
  }

  void ear(double side) {
    const int rings = 9, around = steps(24, 16);
    const double cu = side < 0.0 ? 0.53 : 0.74, cv = 0.108, radius = 0.1;
    std::vector<int> outer;
    for (int i = 0; i <= rings; ++i) {
      std::vector<int> ring;
      const double t = static_cast<double>(i) / rings, rho = radius * (1.0 - t);
      const int count = i == rings ? 1 : around;
      for (int k = 0; k < count; ++k) {
        const double b = 2.0 * pi * k / around;
        Place place{Patch::ear, side};
        place.a = t;
        place.b = b;
        ring.push_back(
            add(place, cu + side * rho * std::cos(b), cv + rho * std::sin(b), FacePart::ear));
      }
      for (int k = 0; k < around && i > 0; ++k) {
        const int n = (k + 1) % around;
        const int a = outer[k], b = outer[n], c = ring[count > 1 ? k : 0],
                  d = ring[count > 1 ? n : 0];
        // The left ear is seen with its angle turning clockwise.
        if (side < 0.0) {
          quad(a, b, c, d);
        } else {
          quad(b, a, d, c);
        }
      }
      outer = std::move(ring);
    }
  }

  double density_;
  Layout layout_;
  std::vector<double> columns_;
};

}  // namespace

Layout make_layout(double density) { return Builder(density).build(); }

}  // namespace semblance::face
