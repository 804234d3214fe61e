#include "face_landmarks.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "face_identity.h"

namespace semblance::face {
namespace {

struct LandmarkPlace {
  SkinPoint point;
  double side;
};

std::vector<LandmarkPlace> ibug_places() {
  std::vector<LandmarkPlace> all;
  // Jaw, from the right ear down and up to the left.
  const std::vector<SkinPoint> jaw = {{column_zygion + 0.25, line_upper_lid},
                                      {column_zygion + 0.4, line_cheek_top + 0.7},
                                      {column_zygion + 0.3, line_tip_low},
                                      {column_zygion, line_mentolabial},
                                      {column_cheek + 0.45, line_pogonion + 0.3},
                                      {column_outer_eye + 0.6, line_jaw - 0.2},
                                      {column_pupil - 0.15, line_jaw - 0.15},
                                      {column_nostril + 0.4, line_jaw - 0.2},
                                      {0, line_jaw}};
  for (int i = 0; i <= 16; ++i)
    all.push_back({jaw[i <= 8 ? i : 16 - i], i < 8 ? -1.0 : i > 8 ? 1.0 : 0.0});
  const double brow = line_brow_top + 0.45;
  const std::vector<SkinPoint> brows = {{column_outer_eye + 0.45, brow + 0.3},
                                        {column_outer_eye - 0.3, brow - 0.08},
                                        {column_pupil - 0.25, brow - 0.05},
                                        {column_inner_eye + 0.6, brow},
                                        {column_nostril + 0.1, brow - 0.1}};
  for (int i = 0; i < 10; ++i) all.push_back({brows[i < 5 ? i : 9 - i], i < 5 ? -1.0 : 1.0});
  all.push_back({{0, line_lid_crease - 0.15}, 0});
  all.push_back({{0, line_cheek_top - 0.1}, 0});
  all.push_back({{0, line_nose_mid}, 0});
  all.push_back({{0, line_ala_top + 0.15}, 0});
  const std::vector<SkinPoint> base = {{column_philtrum + 0.75, line_subnasale - 0.3},
                                       {column_philtrum, line_subnasale - 0.1},
                                       {0, line_subnasale}};
  for (int i = 0; i < 5; ++i)
    all.push_back({base[i <= 2 ? i : 4 - i], i < 2 ? -1.0 : i > 2 ? 1.0 : 0.0});
  const double third = (column_outer_eye - column_inner_eye) / 3.0;
  const std::vector<SkinPoint> eye = {
      {column_outer_eye, line_upper_lid},         {column_outer_eye - third, line_upper_lid},
      {column_inner_eye + third, line_upper_lid}, {column_inner_eye, line_upper_lid},
      {column_inner_eye + third, line_lower_lid}, {column_outer_eye - third, line_lower_lid}};
  for (int i = 0; i < 6; ++i) all.push_back({eye[i], -1.0});
  for (int i : {3, 2, 1, 0, 5, 4}) all.push_back({eye[i], 1.0});
  const std::vector<SkinPoint> upper = {{column_mouth_corner, line_upper_contact},
                                        {column_nostril + 0.6, line_upper_vermilion},
                                        {column_philtrum, line_upper_vermilion},
                                        {0, line_upper_vermilion}};
  for (int i = 0; i < 7; ++i)
    all.push_back({upper[i <= 3 ? i : 6 - i], i < 3 ? -1.0 : i > 3 ? 1.0 : 0.0});
  const std::vector<SkinPoint> lower = {{column_nostril + 0.6, line_lower_vermilion},
                                        {column_philtrum + 0.3, line_lower_vermilion},
                                        {0, line_lower_vermilion}};
  for (int i = 0; i < 5; ++i)
    all.push_back({lower[i <= 2 ? i : 4 - i], i < 2 ? 1.0 : i > 2 ? -1.0 : 0.0});
  const std::vector<SkinPoint> inner = {{column_mouth_corner - 0.3, line_upper_contact},
                                        {column_nostril - 0.4, line_upper_contact},
                                        {0, line_upper_contact}};
  for (int i = 0; i < 5; ++i)
    all.push_back({inner[i <= 2 ? i : 4 - i], i < 2 ? -1.0 : i > 2 ? 1.0 : 0.0});
  const std::vector<SkinPoint> inner_low = {{column_nostril - 0.4, line_lower_contact},
                                            {0, line_lower_contact}};
  for (int i = 0; i < 3; ++i)
    all.push_back({inner_low[i <= 1 ? i : 2 - i], i < 1 ? 1.0 : i > 1 ? -1.0 : 0.0});
  return all;
}

// The triangle and weights of a skin place, found in the plane of column and row.
ModelLandmark located(const std::string& name, const LandmarkPlace& want, const Layout& layout) {
  const bool lower_edge = want.point.row == line_lower_lid || want.point.row == line_lower_contact;
  const double column = want.side < 0.0 ? -want.point.column : want.point.column;
  const auto plane = [&](int v) {
    const Place& p = layout.places[v];
    // The two rows of a slit share their place in the middle of the gap for outside columns.
    return Eigen::Vector2d(p.side < 0.0 ? -p.column : p.column, p.row);
  };
  ModelLandmark best;
  best.name = name;
  double best_score = -1e9;
  for (std::size_t t = 0; t < layout.triangles.size(); ++t) {
    const Eigen::Vector3i& tri = layout.triangles[t];
    bool skin = true;
    for (int k = 0; k < 3; ++k) skin = skin && layout.places[tri[k]].patch == Patch::skin;
    if (!skin) continue;
    const Eigen::Vector2d a = plane(tri[0]), b = plane(tri[1]), c = plane(tri[2]);
    if (lower_edge != (std::max({a.y(), b.y(), c.y()}) > want.point.row + 1e-9) &&
        (lower_edge || want.point.row == line_upper_lid || want.point.row == line_upper_contact)) {
      continue;
    }
    if (std::min({a.x(), b.x(), c.x()}) > column + 1.0 ||
        std::max({a.x(), b.x(), c.x()}) < column - 1.0)
      continue;
    Eigen::Matrix2d m;
    m << b - a, c - a;
    if (std::abs(m.determinant()) < 1e-12) continue;
    const Eigen::Vector2d w = m.inverse() * (Eigen::Vector2d(column, want.point.row) - a);
    const std::array<double, 3> weights{1.0 - w.x() - w.y(), w.x(), w.y()};
    const double score = std::min({weights[0], weights[1], weights[2]});
    if (score > best_score) {
      best_score = score;
      best.triangle = static_cast<int>(t);
      double sum = 0.0;
      for (int k = 0; k < 3; ++k) sum += std::max(0.0, weights[k]);
      for (int k = 0; k < 3; ++k)
        best.barycentric[k] = static_cast<float>(std::max(0.0, weights[k]) / sum);
    }
  }
  return best;
}

}  // namespace

std::vector<ModelLandmark> ibug_landmarks(const Layout& layout) {
  const auto places = ibug_places();
  std::vector<ModelLandmark> landmarks;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::string number = std::to_string(100 + i).substr(1);
    landmarks.push_back(located("ibug_" + number, places[i], layout));
  }
  return landmarks;
}

}  // namespace semblance::face
