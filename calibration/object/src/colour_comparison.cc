#include "colour_comparison.h"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <limits>

namespace semblance {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kBasis = 9, kLight = 3 * kBasis, kSystematic = 10;
constexpr int kBlock_px = 6;        // in which one gain holds
constexpr double kGainSigma = 0.1;  // of a block's gain
constexpr double kRidge = 1e-4;     // of the light's equations, relative to the ambient term's
constexpr double kDarkest = 1e-3;   // light, whose root has no slope at zero
using Basis = Eigen::Matrix<double, kBasis, 1>;

/// sh_basis and its derivative by the normal.
Basis basis_of(const Vector3d& n) {
  Basis out;
  const auto values =
      sh_basis(static_cast<float>(n.x()), static_cast<float>(n.y()), static_cast<float>(n.z()));
  for (int k = 0; k < kBasis; ++k) out[k] = values[static_cast<std::size_t>(k)];
  return out;
}

Eigen::Matrix<double, kBasis, 3> basis_slope(const Vector3d& n) {
  Eigen::Matrix<double, kBasis, 3> out;
  out << 0, 0, 0,         //
      0, 1, 0,            //
      0, 0, 1,            //
      1, 0, 0,            //
      n.y(), n.x(), 0,    //
      0, n.z(), n.y(),    //
      0, 0, 6.0 * n.z(),  //
      n.z(), 0, n.x(),    //
      2.0 * n.x(), -2.0 * n.y(), 0;
  return out;
}

/// Encoded albedo and confidence, bilinear.
std::array<double, 4> albedo_at(const AlbedoPyramid::Level& level, double u, double v) {
  const double x = std::clamp(u * level.width - 0.5, 0.0, level.width - 1.0),
               y = std::clamp((1.0 - v) * level.height - 0.5, 0.0, level.height - 1.0);
  const int x0 = std::min(static_cast<int>(x), level.width - 2),
            y0 = std::min(static_cast<int>(y), level.height - 2);
  const double fx = x - x0, fy = y - y0;
  std::array<double, 4> out{};
  for (int k = 0; k < 4; ++k) {
    const double weight = (k % 2 == 0 ? 1.0 - fx : fx) * (k / 2 == 0 ? 1.0 - fy : fy);
    const float* texel =
        level.texels.data() + std::size_t{4} * ((y0 + k / 2) * level.width + x0 + k % 2);
    for (std::size_t c = 0; c < 4; ++c) out[c] += weight * texel[c];
  }
  return out;
}

/// Pixels that show the surface alone: near a border they are mixed with what lies behind.
std::vector<char> interior(const Synthesis& synthesis, double deepest_step_m) {
  const int width = synthesis.camera.width, height = synthesis.camera.height;
  std::vector<float> depth(static_cast<std::size_t>(width) * height, 0.0f);
  const VisiblePixels& seen = synthesis.pixels;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    depth[static_cast<std::size_t>(seen.pixel[i])] = seen.depth_m[i];
  }
  constexpr int border_px = 2;
  std::vector<char> out(seen.size(), 0);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const int x = seen.pixel[i] % width, y = seen.pixel[i] / width;
    if (x < border_px || y < border_px || x >= width - border_px || y >= height - border_px) {
      continue;
    }
    const auto same = [&](int pixel) {
      const float there = depth[static_cast<std::size_t>(pixel)];
      return there > 0.0f && std::abs(there - seen.depth_m[i]) < deepest_step_m;
    };
    out[i] = same(seen.pixel[i] - border_px) && same(seen.pixel[i] + border_px) &&
             same(seen.pixel[i] - border_px * width) && same(seen.pixel[i] + border_px * width);
  }
  return out;
}

/// One visible pixel, compared.
struct PixelTerm {
  std::size_t index = 0;
  Eigen::Vector2d place_px = Eigen::Vector2d::Zero();  // in the picture of the comparison
  Vector3d residual = Vector3d::Zero();
  double weight = 0.0;  // robust, over the variance
  Basis basis;
  Vector3d by_light;  // of a channel's residual by its light
  std::size_t block = 0;
  Vector3d by_gain;  // of the block
  Eigen::Matrix<double, 3, 2> gradient;
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor, 3, kMostParameters> jacobian;
};

/// Sums of what parameters (p), light (l) and the gains of blocks (g, a column each) have to do
/// with each other. Gains do not meet each other.
struct Equations {
  Equations(Eigen::Index size, Eigen::Index blocks)
      : pp(MatrixXd::Zero(size, size)),
        pl(MatrixXd::Zero(size, kLight)),
        ll(MatrixXd::Zero(kLight, kLight)),
        pg(MatrixXd::Zero(size, blocks)),
        lg(MatrixXd::Zero(kLight, blocks)),
        p(VectorXd::Zero(size)),
        l(VectorXd::Zero(kLight)),
        g(VectorXd::Zero(blocks)),
        gg(VectorXd::Zero(blocks)) {}
  MatrixXd pp, pl, ll, pg, lg;
  VectorXd p, l, g, gg;

  void add(const PixelTerm& term, bool derivatives) {
    const auto block = static_cast<Eigen::Index>(term.block);
    g[block] += term.weight * term.by_gain.dot(term.residual);
    gg[block] += term.weight * term.by_gain.squaredNorm();
    const Eigen::Matrix<double, kBasis, kBasis> square = term.basis * term.basis.transpose();
    for (int c = 0; c < 3; ++c) {
      const int at = kBasis * c;
      const double slope = term.weight * term.by_light[c];
      ll.block<kBasis, kBasis>(at, at) += slope * term.by_light[c] * square;
      l.segment<kBasis>(at) += slope * term.residual[c] * term.basis;
      lg.col(block).segment<kBasis>(at) += slope * term.by_gain[c] * term.basis;
      if (!derivatives) continue;
      pl.middleCols<kBasis>(at) +=
          slope * term.jacobian.row(c).transpose() * term.basis.transpose();
    }
    if (!derivatives) return;
    pg.col(block) += term.weight * term.jacobian.transpose().lazyProduct(term.by_gain);
    pp += term.weight * term.jacobian.transpose().lazyProduct(term.jacobian);
    p += term.weight * term.jacobian.transpose().lazyProduct(term.residual);
  }

  /// The inverse of the gains' own part; the equations are to be scaled by `scale`.
  VectorXd gain_inverse(double scale) const {
    return (gg.array() + 1.0 / (scale * kGainSigma * kGainSigma)).inverse();
  }

  /// Takes the gains out of the rest. Returns by how much their best values lower the cost.
  double eliminate_gains(double scale) {
    const VectorXd inverse = gain_inverse(scale);
    const MatrixXd pull_p = pg * inverse.asDiagonal(), pull_l = lg * inverse.asDiagonal();
    pp -= pull_p * pg.transpose();
    pl -= pull_p * lg.transpose();
    ll -= pull_l * lg.transpose();
    p -= pull_p * g;
    l -= pull_l * g;
    return 0.5 * g.dot(inverse.cwiseProduct(g));
  }

  Eigen::LDLT<MatrixXd> light() const {
    MatrixXd held = ll;
    const double ambient = (ll(0, 0) + ll(kBasis, kBasis) + ll(2 * kBasis, 2 * kBasis)) / 3.0;
    held.diagonal().array() += kRidge * ambient + 1e-12;
    return held.ldlt();
  }
};

/// Displacements that a camera or a comparison may get wrong all over, at most 1 within `half_px`
/// of `middle`.
std::array<Eigen::Vector2d, kSystematic> systematic_at(const Eigen::Vector2d& place_px,
                                                       const Eigen::Vector2d& middle_px,
                                                       double half_px) {
  const Eigen::Vector2d at = (place_px - middle_px) / half_px;
  const double x = at.x(), y = at.y();
  return {{{1, 0},
           {0, 1},
           {x, 0},
           {0, y},
           {y, 0},
           {0, x},
           {x * x, 0},
           {0, y * y},
           {x * y, 0},
           {0, x * y}}};
}

}  // namespace

Eigen::Index ColourComparison::blocks() const {
  return static_cast<Eigen::Index>(observation_.width / kBlock_px + 1) *
         (observation_.height / kBlock_px + 1);
}

std::size_t ColourComparison::block_of(int pixel) const {
  const int x = pixel % observation_.width, y = pixel / observation_.width;
  return static_cast<std::size_t>(y / kBlock_px) * (observation_.width / kBlock_px + 1) +
         x / kBlock_px;
}

template <class Use>
ColourComparison::Mean ColourComparison::for_each_pixel(const PictureView& view,
                                                        const Synthesis& synthesis,
                                                        bool derivatives, const Use& use) const {
  const VisiblePixels& seen = synthesis.pixels;
  const AlbedoPyramid::Level& texture =
      target_.appearance->albedo().levels[static_cast<std::size_t>(options_.texture_level)];
  const Eigen::Matrix3d turn = view.camera_from_object.rotation.toRotationMatrix();
  Eigen::Matrix<double, kBasis, 3> light;
  for (int k = 0; k < kBasis; ++k) {
    light.row(k) =
        synthesis.scene.light.coefficients[static_cast<std::size_t>(k)].cast<double>().transpose();
  }
  const double variance = options_.sigma * options_.sigma,
               width = options_.robust_width * options_.robust_width;
  constexpr double deepest_step = 0.05;  // of the object's size, between pixels of one surface
  const std::vector<char> inside = interior(synthesis, deepest_step * target_.size_m);
  // So many tell as much as more would.
  constexpr std::size_t enough = 15'000;
  const std::size_t stride = std::max<std::size_t>(1, seen.size() / enough);
  double weights = 0.0, cost = 0.0;
  PixelTerm term;
  for (std::size_t i = 0; i < seen.size(); i += stride) {
    if (!inside[i]) continue;
    const auto& corner = target_.topology.triangles[static_cast<std::size_t>(seen.triangle[i])];
    const std::array<double, 3> b{1.0 - seen.b1[i] - seen.b2[i], seen.b1[i], seen.b2[i]};
    Vector3d point = Vector3d::Zero(), normal = Vector3d::Zero();
    Eigen::Vector2d uv = Eigen::Vector2d::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      point += b[k] * target_.mesh.positions_m.row(corner[k]).transpose();
      normal += b[k] * target_.normals.row(corner[k]).transpose().cast<double>();
      uv += b[k] * target_.mesh.uvs.row(corner[k]).transpose().cast<double>();
    }
    const auto albedo = albedo_at(texture, uv.x(), uv.y());
    normal = turn * normal.normalized();
    term.index = i;
    term.place_px = {seen.pixel[i] % observation_.width + 0.5,
                     static_cast<double>(seen.pixel[i] / observation_.width) + 0.5};
    term.basis = basis_of(normal);
    const float* observed = observation_.colour(seen.pixel[i]);
    const Vector3d lit = (light.transpose() * term.basis).cwiseMax(kDarkest).cwiseSqrt();
    for (int c = 0; c < 3; ++c) {
      const double a = albedo[static_cast<std::size_t>(c)];
      term.residual[c] = a * lit[c] - observed[c];
      term.by_light[c] = 0.5 * a / lit[c];
      term.by_gain[c] = a * lit[c];
    }
    term.block = block_of(seen.pixel[i]);
    const double square = term.residual.squaredNorm() / variance, q = 1.0 / (1.0 + square / width);
    term.weight = albedo[3] * q * q / variance;
    weights += albedo[3];
    cost += albedo[3] * 0.5 * square * q;
    if (derivatives) {
      for (int c = 0; c < 3; ++c) {
        term.gradient(c, 0) = observation_.gradient(c, seen.pixel[i]);
        term.gradient(c, 1) = observation_.gradient(4 + c, seen.pixel[i]);
      }
      const PointMotion motion = view.motion(point);
      term.jacobian = -term.gradient.lazyProduct(motion.by_parameters);
      // A turn w moves the normal by w x n.
      const Eigen::Matrix3d by_normal =
          term.by_light.asDiagonal() * light.transpose() * basis_slope(normal);
      Eigen::Matrix3d turned;
      turned << 0.0, normal.z(), -normal.y(), -normal.z(), 0.0, normal.x(), normal.y(), -normal.x(),
          0.0;
      term.jacobian.middleCols<3>(motion.by_parameters.cols() - 6) += by_normal * turned;
    }
    use(term);
  }
  // The whole is the pixels' mean, so that hiding a bad pixel gains nothing.
  return {weights > 0.0 ? cost / weights : std::numeric_limits<double>::infinity(), weights};
}

double ColourComparison::evaluate(const PictureView& view, const Synthesis& synthesis,
                                  NormalEquations* out) const {
  const bool derivatives = out != nullptr;
  Equations sums(derivatives ? out->gradient.size() : 0, blocks());
  const Mean mean = for_each_pixel(view, synthesis, derivatives,
                                   [&](const PixelTerm& term) { sums.add(term, derivatives); });
  if (!std::isfinite(mean.cost)) return mean.cost;
  const double per_pixel = options_.reference_pixels / options_.correlation_area_px;
  const double scale = per_pixel / mean.weights;
  const double by_gains = scale * sums.eliminate_gains(scale);
  const auto light = sums.light();
  const VectorXd step = light.solve(sums.l);
  if (derivatives) {
    out->hessian += scale * (sums.pp - sums.pl * light.solve(sums.pl.transpose()));
    out->gradient += scale * (sums.p - sums.pl * step);
  }
  return std::max(0.0, per_pixel * mean.cost - by_gains - scale * 0.5 * sums.l.dot(step));
}

ColourComparison::Scores ColourComparison::scores(const PictureView& view,
                                                  const Synthesis& synthesis,
                                                  const std::vector<int>& cell, int cells,
                                                  double systematic_px) const {
  const Eigen::Index size = view.parameters();
  Equations sums(size, blocks());
  Scores out{MatrixXd::Zero(size, cells), MatrixXd::Zero(size, kSystematic)};
  MatrixXd cells_l = MatrixXd::Zero(kLight, cells),
           systematic_l = MatrixXd::Zero(kLight, kSystematic);
  MatrixXd cells_g = MatrixXd::Zero(blocks(), cells),
           systematic_g = MatrixXd::Zero(blocks(), kSystematic);
  Eigen::AlignedBox2d box;
  for (const std::int32_t pixel : synthesis.pixels.pixel) {
    box.extend(Eigen::Vector2d(pixel % observation_.width, pixel / observation_.width));
  }
  const double half_px = 0.5 * std::max(box.sizes().maxCoeff(), 1.0);
  const auto add = [&](const PixelTerm& term, const Vector3d& residual, auto p, auto l, auto g) {
    g[static_cast<Eigen::Index>(term.block)] += term.weight * term.by_gain.dot(residual);
    p += term.weight * term.jacobian.transpose().lazyProduct(residual);
    for (int c = 0; c < 3; ++c) {
      l.template segment<kBasis>(kBasis * c) +=
          term.weight * term.by_light[c] * residual[c] * term.basis;
    }
  };
  const Mean mean = for_each_pixel(view, synthesis, true, [&](const PixelTerm& term) {
    sums.add(term, true);
    const int at = cell[term.index];
    add(term, term.residual, out.cells.col(at), cells_l.col(at), cells_g.col(at));
    const auto displacements = systematic_at(term.place_px, box.center(), half_px);
    for (int k = 0; k < kSystematic; ++k) {
      const Vector3d residual =
          systematic_px * term.gradient * displacements[static_cast<std::size_t>(k)];
      add(term, residual, out.systematic.col(k), systematic_l.col(k), systematic_g.col(k));
    }
  });
  if (!(mean.weights > 0.0)) return out;
  const double scale = options_.reference_pixels / options_.correlation_area_px / mean.weights;
  const VectorXd gain_inverse = sums.gain_inverse(scale);
  const auto without_gains = [&](MatrixXd& p, MatrixXd& l, const MatrixXd& g) {
    p -= sums.pg * gain_inverse.asDiagonal() * g;
    l -= sums.lg * gain_inverse.asDiagonal() * g;
  };
  without_gains(out.cells, cells_l, cells_g);
  without_gains(out.systematic, systematic_l, systematic_g);
  sums.eliminate_gains(scale);
  const auto light = sums.light();
  out.cells = scale * (out.cells - sums.pl * light.solve(cells_l));
  out.systematic = scale * (out.systematic - sums.pl * light.solve(systematic_l));
  return out;
}

}  // namespace semblance
