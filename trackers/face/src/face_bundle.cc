#include "face_bundle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>

#include "face_parts.h"
#include "semblance/core/parallel.h"
#include "semblance/io/track_file.h"
#include "semblance/cost/landmark.h"
#include "semblance/cost/prior.h"

namespace semblance {

namespace {

constexpr double kEyeDistance_m = 0.063;
constexpr double kFirstSigma = 0.04, kRobustWidth = 3.0;  // of albedo residuals, encoded intensity
constexpr double kLeastSigma = 0.01, kLargestSigma = 0.06;
const double kCorrelationArea_px2 = ::getenv("BCA") ? atof(::getenv("BCA")) : 40.0;        // at full resolution, as while tracking
constexpr float kLeastCosine = 0.25f;
constexpr float kDepthTolerance_m = 0.006f;

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

constexpr int kLight = 9;
constexpr double kLightSigma = 0.1;

/// Where the entries of one keyframe's model vector are in the bundle's: identity is shared.
struct Layout {
  Layout(const ParameterSpace& model, int identities, std::size_t keyframes)
      : identity_size(identities), own_size(model.size() - identities), space(blocks(model, identities, keyframes)) {}

  /// Logarithm of a keyframe's encoded light relative to the common one, in the SH basis.
  static ParameterBlock light_block(const std::string& suffix) {
    ParameterBlock block;
    block.name = "light" + suffix;
    block.size = kLight;
    block.lower = Eigen::VectorXd::Constant(kLight, -1.0);
    block.upper = Eigen::VectorXd::Constant(kLight, 1.0);
    block.prior_mean = Eigen::VectorXd::Zero(kLight);
    block.prior_sigma = Eigen::VectorXd::Constant(kLight, kLightSigma);
    return block;
  }
  static ParameterSpace blocks(const ParameterSpace& model, int identities, std::size_t keyframes) {
    const auto& all = model.blocks();
    std::vector<ParameterBlock> out(all.begin() + 2, all.begin() + 2 + identities);
    for (std::size_t k = 0; k < keyframes; ++k) {
      const std::string suffix = "_" + std::to_string(k);
      for (std::size_t b = 0; b < all.size(); ++b) {
        if (b >= 2 && b < 2 + static_cast<std::size_t>(identities)) continue;
        out.push_back(all[b]);
        out.back().name += suffix;
      }
      out.push_back(light_block(suffix));
    }
    return ParameterSpace(std::move(out));
  }

  Eigen::Index first(std::size_t k) const {
    return identity_size + static_cast<Eigen::Index>(k) * (own_size + kLight);
  }
  Eigen::VectorXd light(const Eigen::VectorXd& x, std::size_t k) const {
    return x.segment(first(k) + own_size, kLight);
  }
  /// The model's vector of keyframe k.
  Eigen::VectorXd view(const Eigen::VectorXd& x, std::size_t k) const {
    Eigen::VectorXd out(own_size + identity_size);
    const auto own = x.segment(first(k), own_size);
    out << own.head<7>(), x.head(identity_size), own.tail(own_size - 7);
    return out;
  }
  Eigen::VectorXd join(const std::vector<Eigen::VectorXd>& views) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(first(views.size()));
    out.head(identity_size) = views.front().segment(7, identity_size);
    for (std::size_t k = 0; k < views.size(); ++k) {
      out.segment(first(k), own_size) << views[k].head<7>(), views[k].tail(own_size - 7);
    }
    return out;
  }
  /// Tangent entry of the bundle for each tangent entry of keyframe k's model, then of its light.
  std::vector<Eigen::Index> tangent(std::size_t k) const {
    const Eigen::Index own = own_size - 1 + kLight;
    const Eigen::Index first = identity_size + static_cast<Eigen::Index>(k) * own;
    std::vector<Eigen::Index> out;
    for (Eigen::Index i = 0; i < 6; ++i) out.push_back(first + i);
    for (Eigen::Index i = 0; i < identity_size; ++i) out.push_back(i);
    for (Eigen::Index i = 6; i < own; ++i) out.push_back(first + i);
    return out;
  }

  Eigen::Index identity_size, own_size;
  ParameterSpace space;
};

/// What one keyframe sees at the start of a minimisation: which triangles, how much they count, and
/// the common light on them. It stays fixed meanwhile, which keeps the cost smooth: what a turn does
/// to shading is left to the keyframe's own light, which would explain it anyway.
struct View {
  std::vector<int> triangle;
  std::vector<float> size;                    // share of the picture, in independent residuals
  std::vector<Eigen::Vector3f> root_of_light;  // encoded
  std::vector<std::array<float, 9>> basis;
};

/// Albedo that one keyframe shows at the middles of the triangles it sees.
struct Samples {
  std::vector<float> albedo;  // encoded grey
  std::vector<float> weight;  // size over the variance of `albedo`
  std::vector<Eigen::Vector3f> encoded, root_of_light;
  Rows jacobian;  // row i: derivative of albedo[i] by the model's tangent entries, then the light's
};

/// Grey of an encoded pixel record under light, bilinear; and its derivatives if asked.
struct Grey {
  float value, dx, dy;
};

Grey sample_grey(const ObservationLevel& level, float x, float y, const Eigen::Vector3f& by) {
  const float cx = x - 0.5f, cy = y - 0.5f;
  const int column = static_cast<int>(cx), row = static_cast<int>(cy);
  const float px = cx - static_cast<float>(column), py = cy - static_cast<float>(row);
  Grey out{0, 0, 0};
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const float w = (i == 0 ? 1.0f - px : px) * (j == 0 ? 1.0f - py : py);
      const std::size_t pixel = static_cast<std::size_t>(row + j) * level.width + column + i;
      const float* colour = level.encoded.data() + 4 * pixel;
      const float* gradient = level.gradient.data() + 8 * pixel;
      for (int c = 0; c < 3; ++c) {
        out.value += w * by[c] * colour[c];
        out.dx += w * by[c] * gradient[c];
        out.dy += w * by[c] * gradient[4 + c];
      }
    }
  }
  return out;
}

Eigen::Vector3f sample_colour(const ObservationLevel& level, float x, float y) {
  const float cx = x - 0.5f, cy = y - 0.5f;
  const int column = static_cast<int>(cx), row = static_cast<int>(cy);
  const float px = cx - static_cast<float>(column), py = cy - static_cast<float>(row);
  const auto at = [&](int j, int i) {
    return Eigen::Map<const Eigen::Vector3f>(
        level.encoded.data() + 4 * (static_cast<std::size_t>(row + j) * level.width + column + i));
  };
  return (1 - py) * ((1 - px) * at(0, 0) + px * at(0, 1)) +
         py * ((1 - px) * at(1, 0) + px * at(1, 1));
}

/// One keyframe's view of a triangle: entry `index` of its lists.
struct Sighting {
  std::size_t view, index;
};

/// A camera in single precision.
struct Projection {
  explicit Projection(const Camera& camera)
      : rotation(camera.camera_from_world.rotation.toRotationMatrix().cast<float>()),
        translation(camera.camera_from_world.translation_m.cast<float>()),
        focal(camera.focal_px.cast<float>()),
        centre(camera.principal_px.cast<float>()) {}
  Eigen::Vector3f camera_point(const Eigen::RowVector3f& world) const {
    return rotation * world.transpose() + translation;
  }
  Eigen::Vector2f pixel(const Eigen::Vector3f& p) const {
    return focal.cwiseProduct(p.head<2>()) / p.z() + centre;
  }
  ImageFromWorld derivative(const Eigen::Vector3f& p) const {
    ImageFromWorld out;
    for (int axis = 0; axis < 2; ++axis) {
      out.row(axis) =
          focal[axis] * (rotation.row(axis) - p[axis] / p.z() * rotation.row(2)) / p.z();
    }
    return out;
  }
  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation;
  Eigen::Vector2f focal, centre;
};

/// The bundle at one level of the pyramids, with the lights fixed.
class BundleObjective : public Objective {
 public:
  struct Problem {
    const FaceFitter& fitter;
    const MorphModel& model;
    const SurfaceTopology& topology;
    const std::vector<float>& triangle_weight;
    Camera camera;  // of full resolution
    const std::vector<Keyframe>& keyframes;
    const Layout& layout;
  };

  BundleObjective(const Problem& problem, int level, const ShLight& light, const Eigen::VectorXd& start,
                  double sigma);

  const ParameterSpace& space() const override { return problem_.layout.space; }
  double evaluate(const Eigen::VectorXd& x) const override { return build(x, nullptr); }
  bool normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const override {
    out.reset(space().tangent_size());
    out.cost = build(x, &out);
    return std::isfinite(out.cost);
  }
  /// Robust deviation of what keyframes show of the same place.
  double deviation(const Eigen::VectorXd& x) const;
  /// Lights that agree best with the mean albedo of all keyframes.
  std::vector<ShLight> refined_light(const Eigen::VectorXd& x) const;

 private:
  double build(const Eigen::VectorXd& x, NormalEquations* out) const;
  double albedo_term(const std::vector<Samples>& samples, NormalEquations* out) const;
  std::vector<std::vector<Sighting>> sightings_;
  Camera camera(std::size_t k) const;
  View look(const Eigen::VectorXd& x, std::size_t k) const;
  Samples sample(const Eigen::VectorXd& x, std::size_t k, bool with_jacobian) const;

  Problem problem_;
  int level_;
  ShLight light_;
  std::vector<View> views_;
  double sigma_;
};

BundleObjective::BundleObjective(const Problem& problem, int level, const ShLight& light,
                                 const Eigen::VectorXd& start, double sigma)
    : problem_(problem), level_(level), light_(light), sigma_(sigma) {
  views_.resize(problem_.keyframes.size());
  parallel_for(views_.size(), [&](std::size_t k) { views_[k] = look(start, k); });
  sightings_.resize(problem_.topology.triangles.size());
  for (std::size_t k = 0; k < views_.size(); ++k) {
    for (std::size_t i = 0; i < views_[k].triangle.size(); ++i) {
      sightings_[static_cast<std::size_t>(views_[k].triangle[i])].push_back({k, i});
    }
  }
  std::erase_if(sightings_, [](const auto& seen) { return seen.size() < 2; });
}

Camera BundleObjective::camera(std::size_t k) const {
  return problem_.camera.scaled(problem_.keyframes[k].observation->levels[level_].scale);
}

View BundleObjective::look(const Eigen::VectorXd& x, std::size_t k) const {
  const Camera camera = this->camera(k);
  const double scale = problem_.keyframes[k].observation->levels[level_].scale;
  const auto area_px = static_cast<float>(std::max(1.0, kCorrelationArea_px2 * scale * scale));
  Scene scene;
  problem_.model.synthesize(problem_.layout.view(x, k), scene);
  Rasteriser rasteriser(Rasteriser::Instructions::best, Rasteriser::Faces::front);
  VisiblePixels pixels;
  rasteriser.visible_pixels(scene, camera, nullptr, pixels);
  std::vector<float> depth(static_cast<std::size_t>(camera.width) * camera.height, -1.0f);
  for (std::size_t i = 0; i < pixels.size(); ++i) depth[pixels.pixel[i]] = pixels.depth_m[i];
  const SceneObject& object = scene.objects[0];
  const Projection project(camera);
  View out;
  for (std::size_t t = 0; t < problem_.topology.triangles.size(); ++t) {
    if (problem_.triangle_weight[t] <= 0.0f) continue;
    Eigen::Vector2f corner[3];
    Eigen::Vector3f middle = Eigen::Vector3f::Zero(), normal = Eigen::Vector3f::Zero();
    for (int i = 0; i < 3; ++i) {
      const int v = problem_.topology.triangles[t][i];
      const Eigen::Vector3f p = project.camera_point(object.positions_m.row(v));
      middle += p / 3.0f;
      normal += object.normals.row(v).transpose();
      corner[i] = project.pixel(p);
    }
    if (!(middle.z() > 0.01f)) continue;
    normal.normalize();
    const float cosine = -(project.rotation * normal).dot(middle.normalized());
    if (cosine < kLeastCosine) continue;
    const Eigen::Vector2f at = project.pixel(middle);
    if (!(at.x() >= 2 && at.y() >= 2 && at.x() < static_cast<float>(camera.width - 2) &&
          at.y() < static_cast<float>(camera.height - 2)))
      continue;
    const float seen = depth[static_cast<std::size_t>(at.y()) * camera.width +
                             static_cast<std::size_t>(at.x())];
    if (seen < 0.0f || std::abs(seen - middle.z()) > kDepthTolerance_m) continue;
    const Eigen::Vector2f a = corner[1] - corner[0], b = corner[2] - corner[0];
    const float area = 0.5f * std::abs(a.x() * b.y() - a.y() * b.x());
    out.triangle.push_back(static_cast<int>(t));
    out.size.push_back(problem_.triangle_weight[t] * cosine * cosine * area / area_px);
    out.basis.push_back(sh_basis(normal.x(), normal.y(), normal.z()));
    Eigen::Vector3f lit = Eigen::Vector3f::Zero();
    for (int j = 0; j < 9; ++j) lit += out.basis.back()[j] * light_.coefficients[j];
    out.root_of_light.push_back(lit.cwiseMax(0.01f).cwiseSqrt());
  }
  return out;
}

Samples BundleObjective::sample(const Eigen::VectorXd& x, std::size_t k,
                                bool with_jacobian) const {
  const View& view = views_[k];
  const ObservationLevel& level = problem_.keyframes[k].observation->levels[level_];
  const Eigen::VectorXd model_x = problem_.layout.view(x, k);
  const Eigen::VectorXf own_light = problem_.layout.light(x, k).cast<float>();
  Scene scene;
  problem_.model.synthesize(model_x, scene);
  const PointsF& positions = scene.objects[0].positions_m;
  const Projection project(camera(k));
  const auto& corners = problem_.topology.triangles;
  const Eigen::Vector2f last(level.width - 1.01f, level.height - 1.01f);
  Samples out;
  std::vector<Grey> grey;
  for (std::size_t i = 0; i < view.triangle.size(); ++i) {
    const auto& corner = corners[static_cast<std::size_t>(view.triangle[i])];
    const Eigen::Vector3f middle = project.camera_point(
        (positions.row(corner[0]) + positions.row(corner[1]) + positions.row(corner[2])) / 3.0f);
    const Eigen::Vector2f at = project.pixel(middle).cwiseMax(1.0f).cwiseMin(last);
    const Eigen::Vector3f root =
        std::exp(Eigen::Map<const Eigen::VectorXf>(view.basis[i].data(), kLight).dot(own_light)) *
        view.root_of_light[i];
    grey.push_back(sample_grey(level, at.x(), at.y(), (3.0f * root).cwiseInverse()));
    out.albedo.push_back(grey.back().value);
    out.encoded.push_back(sample_colour(level, at.x(), at.y()));
    out.root_of_light.push_back(root);
    const float noise = static_cast<float>(sigma_) / view.root_of_light[i].mean();
    out.weight.push_back(view.size[i] / (noise * noise));
  }
  if (!with_jacobian) return out;

  std::vector<int> vertices(static_cast<std::size_t>(positions.rows()));
  std::vector<ImageFromWorld> image_from_world(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    vertices[v] = static_cast<int>(v);
    image_from_world[v] =
        project.derivative(project.camera_point(positions.row(static_cast<Eigen::Index>(v))));
  }
  const Eigen::Index size = problem_.model.parameters().tangent_size();
  std::vector<int> columns(static_cast<std::size_t>(size));
  std::iota(columns.begin(), columns.end(), 0);
  VertexJacobian motion(2 * static_cast<Eigen::Index>(vertices.size()),
                        SurfaceEquations::padded_columns(size));
  problem_.model.image_jacobian(model_x, columns, vertices, image_from_world, motion);
  out.jacobian.resize(static_cast<Eigen::Index>(view.triangle.size()), size + kLight);
  for (std::size_t i = 0; i < view.triangle.size(); ++i) {
    auto row = out.jacobian.row(static_cast<Eigen::Index>(i));
    row.setZero();
    for (int v : corners[static_cast<std::size_t>(view.triangle[i])]) {
      row.head(size) += grey[i].dx / 3.0f * motion.row(2 * v).head(size) +
                        grey[i].dy / 3.0f * motion.row(2 * v + 1).head(size);
    }
    row.tail<kLight>() =
        -out.albedo[i] * Eigen::Map<const Eigen::RowVectorXf>(view.basis[i].data(), kLight);
  }
  return out;
}

/// Robust mean over the sightings; replaces `weight` by the robust weights. Returns the robust
/// cost.
double robust_mean(const std::vector<Sighting>& seen, const std::vector<Samples>& views, double sigma,
                   std::vector<double>& weight, double& mean) {
  const auto albedo = [&](std::size_t s) { return views[seen[s].view].albedo[seen[s].index]; };
  const auto prior = [&](std::size_t s) { return views[seen[s].view].weight[seen[s].index]; };
  weight.resize(seen.size());
  for (std::size_t s = 0; s < seen.size(); ++s) weight[s] = prior(s);
  double cost = 0.0;
  for (int round = 0; round < 3; ++round) {
    double sum = 0.0, total = 0.0;
    for (std::size_t s = 0; s < seen.size(); ++s) {
      sum += weight[s] * albedo(s);
      total += weight[s];
    }
    mean = sum / total;
    cost = 0.0;
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const double r = (albedo(s) - mean) / (sigma * kRobustWidth);
      const double q = 1.0 / (1.0 + r * r);
      if (round < 2) weight[s] = prior(s) * q * q;
      cost += 0.5 * prior(s) * q * (albedo(s) - mean) * (albedo(s) - mean);
    }
  }
  return cost;
}

double BundleObjective::albedo_term(const std::vector<Samples>& views, NormalEquations* out) const {
  const Eigen::Index size = space().tangent_size();
  double cost = 0.0;
  std::vector<double> weight;
  std::vector<std::vector<float>> final_weight(views.size()), residual(views.size());
  for (std::size_t k = 0; k < views.size(); ++k) {
    final_weight[k].assign(views_[k].triangle.size(), 0.0f);
    residual[k].assign(views_[k].triangle.size(), 0.0f);
  }
  const auto shared_count = static_cast<Eigen::Index>(sightings_.size());
  // Row per surface point: sum over the keyframes of weight * derivative, over the root of the sum
  // of weights. Its outer product is what the unknown albedo takes away.
  Rows coupling;
  std::vector<std::vector<Eigen::Index>> tangent;
  for (std::size_t k = 0; k < views.size(); ++k) tangent.push_back(problem_.layout.tangent(k));
  if (out != nullptr) coupling.setZero(shared_count, size);
  Eigen::Index row = 0;
  for (const auto& seen : sightings_) {
    double mean = 0.0;
    cost += robust_mean(seen, views, sigma_, weight, mean);
    double total = 0.0;
    for (std::size_t s = 0; s < seen.size(); ++s) {
      total += weight[s];
    }
    if (out != nullptr) {
      const double scale = 1.0 / std::sqrt(std::max(total, 1e-30));
      for (std::size_t s = 0; s < seen.size(); ++s) {
        const auto [k, i] = seen[s];
        final_weight[k][i] = static_cast<float>(weight[s]);
        residual[k][i] = static_cast<float>(views[k].albedo[i] - mean);
        const auto derivative = views[k].jacobian.row(static_cast<Eigen::Index>(i));
        const auto w = static_cast<float>(weight[s] * scale);
        for (Eigen::Index p = 0; p < derivative.size(); ++p) {
          coupling(row, tangent[k][static_cast<std::size_t>(p)]) += w * derivative[p];
        }
      }
    }
    ++row;
  }
  if (out != nullptr) {
    std::vector<Eigen::MatrixXf> hessian(views.size());
    std::vector<Eigen::VectorXf> gradient(views.size());
    parallel_for(views.size(), [&](std::size_t k) {
      const auto n = static_cast<Eigen::Index>(views_[k].triangle.size());
      const Eigen::Map<const Eigen::VectorXf> w(final_weight[k].data(), n), r(residual[k].data(), n);
      const Rows weighted = w.asDiagonal() * views[k].jacobian;
      hessian[k] = weighted.transpose() * views[k].jacobian;
      gradient[k] = weighted.transpose() * r;
    });
    Eigen::MatrixXf taken = Eigen::MatrixXf::Zero(size, size);
    taken.selfadjointView<Eigen::Lower>().rankUpdate(coupling.transpose());
    out->hessian -= Eigen::MatrixXf(taken.selfadjointView<Eigen::Lower>()).cast<double>();
    for (std::size_t k = 0; k < views.size(); ++k) {
      out->hessian(tangent[k], tangent[k]) += hessian[k].cast<double>();
      out->gradient(tangent[k]) += gradient[k].cast<double>();
    }
  }
  return cost;
}

std::vector<ShLight> BundleObjective::refined_light(const Eigen::VectorXd& x) const {
  using Matrix9 = Eigen::Matrix<double, 9, 9>;
  using Vector9 = Eigen::Matrix<double, 9, 1>;
  constexpr double kPull = 0.05;
  std::vector<Samples> views(problem_.keyframes.size());
  parallel_for(views.size(), [&](std::size_t k) {
    views[k] = sample(x, k, false);
  });
  std::vector<std::array<Matrix9, 3>> normal(views.size());
  std::vector<std::array<Vector9, 3>> right(views.size());
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (int c = 0; c < 3; ++c) normal[k][c].setZero(), right[k][c].setZero();
  }
  std::vector<double> weight;
  for (const auto& seen : sightings_) {
    double grey = 0.0, total = 0.0;
    robust_mean(seen, views, sigma_, weight, grey);
    Eigen::Vector3d albedo = Eigen::Vector3d::Zero();
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const Samples& v = views[seen[s].view];
      albedo += weight[s] * v.encoded[seen[s].index].cwiseQuotient(v.root_of_light[seen[s].index]).cast<double>();
      total += weight[s];
    }
    albedo /= total;
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const auto [k, i] = seen[s];
      Vector9 y;
      for (int b = 0; b < 9; ++b) y[b] = views_[k].basis[i][b];
      for (int c = 0; c < 3; ++c) {
        const double a = albedo[c] * albedo[c];
        const double observed = views[k].encoded[i][c] * views[k].encoded[i][c];
        // d(encoded) = d(linear) / (2 encoded): the weight undoes the encoding.
        const double w = weight[s] / std::max(4.0 * observed, 0.02);
        normal[k][c] += w * a * a * y * y.transpose();
        right[k][c] += w * a * observed * y;
      }
    }
  }
  std::vector<ShLight> out(views.size(), light_);
  for (std::size_t k = 0; k < views.size(); ++k) {
    for (int c = 0; c < 3; ++c) {
      Vector9 before;
      for (int b = 0; b < 9; ++b) before[b] = out[k].coefficients[b][c];
      const double pull = kPull * std::max(normal[k][c](0, 0), 1e-9);
      Matrix9 system = normal[k][c];
      system.diagonal().array() += pull;
      const Vector9 after = system.ldlt().solve(right[k][c] + pull * before);
      if (!after.allFinite()) continue;
      for (int b = 0; b < 9; ++b) out[k].coefficients[b][c] = static_cast<float>(after[b]);
    }
  }
  return out;
}

double BundleObjective::deviation(const Eigen::VectorXd& x) const {
  std::vector<Samples> views(problem_.keyframes.size());
  parallel_for(views.size(), [&](std::size_t k) {
    views[k] = sample(x, k, false);
  });
  std::vector<double> weight, magnitude;
  for (const auto& seen : sightings_) {
    double mean = 0.0;
    robust_mean(seen, views, sigma_, weight, mean);
    const double n = static_cast<double>(seen.size());
    for (const Sighting& s : seen) {
      const Samples& v = views[s.view];
      magnitude.push_back(std::abs(v.albedo[s.index] - mean) * v.root_of_light[s.index].mean() * std::sqrt(n / (n - 1.0)));
    }
  }
  if (magnitude.empty()) return sigma_;
  const auto middle = magnitude.begin() + static_cast<std::ptrdiff_t>(magnitude.size() / 2);
  std::nth_element(magnitude.begin(), middle, magnitude.end());
  return std::clamp(1.4826 * *middle, kLeastSigma, kLargestSigma);
}

double BundleObjective::build(const Eigen::VectorXd& x, NormalEquations* out) const {
  const std::size_t count = problem_.keyframes.size();
  std::vector<Samples> views(count);
  std::vector<NormalEquations> parts(count);
  parallel_for(count, [&](std::size_t k) {
    const Eigen::VectorXd view = problem_.layout.view(x, k);
    views[k] = sample(x, k, out != nullptr);
    parts[k].reset(problem_.model.parameters().tangent_size());
    const Keyframe& keyframe = problem_.keyframes[k];
    parts[k].cost = problem_.fitter.compare_parts(*keyframe.observation, problem_.camera, view,
                                                  keyframe.marks, out != nullptr ? &parts[k] : nullptr);
  });
  double cost = albedo_term(views, out);
  const double share = (::getenv("PW") ? atof(::getenv("PW")) : 1.0) / static_cast<double>(count);
  for (NormalEquations& part : parts) { part.cost *= share; part.hessian *= share; part.gradient *= share; }
  if (::getenv("BUNDLE_LOG") && out == nullptr) { double p = 0; for (auto& q : parts) p += q.cost; fprintf(stderr, "albedo %.2f parts %.2f\n", cost, p); }
  for (std::size_t k = 0; k < count; ++k) {
    cost += parts[k].cost;
    if (out == nullptr) continue;
    auto tangent = problem_.layout.tangent(k);
    tangent.resize(tangent.size() - kLight);
    out->hessian(tangent, tangent) += parts[k].hessian;
    out->gradient(tangent) += parts[k].gradient;
  }
  // Priors of identity and expression.
  const Eigen::VectorXd information =
      space().tangent_prior_sigma().cwiseAbs2().cwiseInverse();
  const Eigen::VectorXd away = space().minus(x, space().initial());
  for (Eigen::Index i = 0; i < away.size(); ++i) {
    if (!(information[i] > 0.0)) continue;
    cost += 0.5 * information[i] * away[i] * away[i];
    if (out == nullptr) continue;
    out->hessian(i, i) += information[i];
    out->gradient[i] += information[i] * away[i];
  }
  return std::isfinite(cost) ? cost : std::numeric_limits<double>::infinity();
}

}  // namespace

FaceBundle adjust_bundle(const FaceFitter& fitter, const MorphModel& model, const Camera& camera,
                         const std::vector<Keyframe>& keyframes) {
  const Layout layout(model.parameters(), model.shape().identity_count, keyframes.size());
  const std::vector<float> weight =
      triangle_weights(model.shape(), fitter.topology(), tracking_weight);
  const BundleObjective::Problem problem{fitter, model, fitter.topology(), weight,
                                         camera, keyframes, layout};
  std::vector<Eigen::VectorXd> views;
  for (const Keyframe& keyframe : keyframes) views.push_back(keyframe.x);
  Eigen::VectorXd x = layout.join(views);
  const ShLight light = fitter.part_light(*keyframes[0].observation, camera, views[0]);
  OptimizerOptions options;
  options.max_iterations = ::getenv("BIT") ? atoi(::getenv("BIT")) : 6;
  options.step_tolerance = 2e-3;
  options.cost_tolerance = 1e-4;
  options.initial_damping = 1e-3;
  const auto optimizer = make_optimizer("lm", options);
  const double depth = (camera.camera_from_world * Eigen::Vector3d(views.front().segment<3>(4))).z();
  const double eyes_px = camera.focal_px.x() * kEyeDistance_m / std::max(depth, 0.05);
  const int coarsest = std::clamp(static_cast<int>(std::floor(std::log2(std::max(eyes_px / 14.0, 1.0)))), 0,
                                  static_cast<int>(keyframes.front().observation->levels.size()) - 1);
  FaceBundle out;
  Solution solution;
  double sigma = kFirstSigma;
  if (const char* path = ::getenv("BUNDLE_TRUTH")) {
    const Track truth = read_track(path);
    std::vector<Eigen::VectorXd> tv;
    for (const Keyframe& keyframe : keyframes) { tv.push_back(truth.frames[keyframe.frame].x); }
    const Eigen::VectorXd tx = layout.join(tv);
    fprintf(stderr, "keyframes:");
    for (const Keyframe& keyframe : keyframes) fprintf(stderr, " %d", keyframe.frame);
    fprintf(stderr, "\n");
    sigma = ::getenv("TS") ? atof(::getenv("TS")) : 0.012;
    for (int level = coarsest; level >= 0; --level) {
      Solution s2; s2.x = tx;
      for (int i = 0; i < 3; ++i) {
      BundleObjective o(problem, level, light, s2.x, sigma);
      fprintf(stderr, "truth level %d round %d\n", level, i);
      s2 = optimizer->minimize(o, s2.x, silent_progress());
      fprintf(stderr, "from truth -> %.2f\n", s2.cost); o.evaluate(s2.x);}
      const Eigen::VectorXd d = layout.space.minus(s2.x, tx);
      for (std::size_t k = 0; k < views.size(); ++k) { auto t = layout.tangent(k); fprintf(stderr, "  moved rot %.2f %.2f %.2f deg, t %.2f %.2f %.2f mm\n", 57.3*d[t[0]], 57.3*d[t[1]], 57.3*d[t[2]], 1e3*d[t[3]], 1e3*d[t[4]], 1e3*d[t[5]]); }
    }
  }
  sigma = kFirstSigma;
  std::vector<ShLight> lights;
  for (int level = coarsest; level >= 0; --level) {
    for (int round = 0; round < 3; ++round) {
      sigma = BundleObjective(problem, level, light, x, sigma).deviation(x);
      const BundleObjective objective(problem, level, light, x, sigma);
      if (::getenv("BGRAD") && round == 2) {
        NormalEquations ne; objective.normal_equations(x, ne);
        unsetenv("BUNDLE_LOG");
        for (int i = 0; i < 33 + 52; ++i) {
          Eigen::VectorXd d = Eigen::VectorXd::Zero(ne.gradient.size());
          const double h = 0.3 / std::sqrt(ne.hessian(i, i));
          d[i] = h;
          const double up = objective.evaluate(layout.space.plus(x, d)), down = objective.evaluate(layout.space.plus(x, -d));
          fprintf(stderr, "grad %d h %.5f analytic %.3f numeric %.3f  second %.3f (1 expected)\n", i, h, ne.gradient[i] * h, 0.5 * (up - down), (up + down - 2 * ne.cost) / (h * h * ne.hessian(i, i)));
        }
      }
      solution = optimizer->minimize(objective, x, silent_progress());
      if (::getenv("BUNDLE_LOG")) fprintf(stderr, "level %d round %d sigma %.4f cost %.1f -> %.1f (%ld evals, %s)\n", level, round, sigma, objective.evaluate(x), solution.cost, (long)solution.evaluations, solution.message.c_str());
      x = solution.x;
      if (level == 0) lights = objective.refined_light(x);
    }
  }
  out.identity = x.head(layout.identity_size);
  out.identity_sigma = solution.covariance
                           ? Eigen::VectorXd(solution.covariance->diagonal().head(layout.identity_size).cwiseSqrt())
                           : Eigen::VectorXd::Constant(layout.identity_size, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < keyframes.size(); ++k) out.x.push_back(layout.view(x, k));
  out.light = lights;
  return out;
}

}  // namespace semblance
