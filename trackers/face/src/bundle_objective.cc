#include "bundle_objective.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "semblance/core/parallel.h"
#include "semblance/cost/light.h"
#include "semblance/render/visibility.h"

namespace semblance {

namespace {

// Residuals larger than this many deviations, and than this encoded intensity, count a quarter:
// eyes and lips that lie beside their place must pull.
constexpr double kRobustWidth = 1.2, kLeastCut = 0.025;
constexpr double kLeastSigma = 0.01, kLargestSigma = 0.06;
constexpr double kCorrelationArea_px2 = 40.0;  // at full resolution, as while tracking
constexpr float kLeastCosine = 0.25f;
constexpr float kDepthTolerance_m = 0.006f;
// Of the logarithm of encoded light between keyframes: shadows, which the common light leaves out.
constexpr double kLightSigma = 0.03;

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

ParameterBlock light_block(const std::string& suffix) {
  constexpr int size = BundleLayout::light_size;
  ParameterBlock block;
  block.name = "light" + suffix;
  block.size = size;
  block.lower = Eigen::VectorXd::Constant(size, -1.0);
  block.upper = Eigen::VectorXd::Constant(size, 1.0);
  block.prior_mean = Eigen::VectorXd::Zero(size);
  block.prior_sigma = Eigen::VectorXd::Constant(size, kLightSigma);
  return block;
}

ParameterSpace bundle_space(const ParameterSpace& model, std::size_t identities,
                            std::size_t keyframes) {
  const auto& all = model.blocks();
  const auto first = all.begin() + MorphModel::first_shape_block;
  const auto last = first + static_cast<std::ptrdiff_t>(identities);
  std::vector<ParameterBlock> out(first, last);
  for (std::size_t k = 0; k < keyframes; ++k) {
    const std::string suffix = "_" + std::to_string(k);
    for (auto block = all.begin(); block != all.end(); ++block) {
      if (block >= first && block < last) continue;
      out.push_back(*block);
      out.back().name += suffix;
    }
    out.push_back(light_block(suffix));
  }
  return ParameterSpace(std::move(out));
}

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

/// Encoded colour and its derivatives between pixels, bilinear.
struct Colour {
  Eigen::Vector3f value = Eigen::Vector3f::Zero(), dx = value, dy = value;
};

Colour sample_colour(const ObservationLevel& level, const Eigen::Vector2f& at) {
  const float x = at.x() - 0.5f, y = at.y() - 0.5f;
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const float px = x - static_cast<float>(column), py = y - static_cast<float>(row);
  Colour out;
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const float w = (i == 0 ? 1.0f - px : px) * (j == 0 ? 1.0f - py : py);
      const auto pixel = static_cast<std::size_t>(row + j) * level.width + column + i;
      const float* gradient = level.gradient.data() + 8 * pixel;
      out.value += w * Eigen::Map<const Eigen::Vector3f>(level.encoded.data() + 4 * pixel);
      out.dx += w * Eigen::Map<const Eigen::Vector3f>(gradient);
      out.dy += w * Eigen::Map<const Eigen::Vector3f>(gradient + 4);
    }
  }
  return out;
}

}  // namespace

BundleLayout::BundleLayout(const ParameterSpace& model, int identities, std::size_t keyframes)
    : identity_size(identities),
      own_size(model.size() - identities),
      space(bundle_space(model, static_cast<std::size_t>(identities), keyframes)) {}

Eigen::VectorXd BundleLayout::model_vector(const Eigen::VectorXd& x, std::size_t k) const {
  Eigen::VectorXd out(own_size + identity_size);
  const auto own = x.segment(first(k), own_size);
  out << own.head<7>(), x.head(identity_size), own.tail(own_size - 7);
  return out;
}

Eigen::VectorXd BundleLayout::light(const Eigen::VectorXd& x, std::size_t k) const {
  return x.segment(first(k) + own_size, light_size);
}

Eigen::VectorXd BundleLayout::join(const std::vector<Eigen::VectorXd>& models) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(first(models.size()));
  out.head(identity_size) = models.front().segment(7, identity_size);
  for (std::size_t k = 0; k < models.size(); ++k) {
    out.segment(first(k), own_size) << models[k].head<7>(), models[k].tail(own_size - 7);
  }
  return out;
}

std::vector<Eigen::Index> BundleLayout::tangent(std::size_t k) const {
  const Eigen::Index own = own_size - 1 + light_size;  // a rotation has one entry less
  const Eigen::Index begin = identity_size + static_cast<Eigen::Index>(k) * own;
  std::vector<Eigen::Index> out;
  for (Eigen::Index i = 0; i < 6; ++i) out.push_back(begin + i);
  for (Eigen::Index i = 0; i < identity_size; ++i) out.push_back(i);
  for (Eigen::Index i = 6; i < own; ++i) out.push_back(begin + i);
  return out;
}

std::vector<Eigen::Index> BundleLayout::model_tangent(std::size_t k) const {
  std::vector<Eigen::Index> out = tangent(k);
  out.resize(out.size() - light_size);
  return out;
}

BundleObjective::BundleObjective(const BundleProblem& problem, int level,
                                 const Eigen::VectorXd& start, double sigma)
    : problem_(problem), level_(level), sigma_(sigma), views_(problem.keyframes.size()) {
  parallel_for(views_.size(), [&](std::size_t k) { views_[k] = look(start, k); });
  sightings_.resize(problem_.triangle_weight.size());
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

BundleObjective::View BundleObjective::look(const Eigen::VectorXd& x, std::size_t k) const {
  const Camera camera = this->camera(k);
  const double scale = problem_.keyframes[k].observation->levels[level_].scale;
  const auto area_px = static_cast<float>(std::max(1.0, kCorrelationArea_px2 * scale * scale));
  Scene scene;
  problem_.model.synthesize(problem_.layout.model_vector(x, k), scene);
  Rasteriser rasteriser(Rasteriser::Instructions::best, Rasteriser::Faces::front);
  VisiblePixels pixels;
  rasteriser.visible_pixels(scene, camera, nullptr, pixels);
  std::vector<float> depth(static_cast<std::size_t>(camera.width) * camera.height, -1.0f);
  for (std::size_t i = 0; i < pixels.size(); ++i) depth[pixels.pixel[i]] = pixels.depth_m[i];
  const SceneObject& object = scene.objects[0];
  const Projection project(camera);
  const auto& triangles = problem_.fitter.topology().triangles;
  View out;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (problem_.triangle_weight[t] <= 0.0f) continue;
    Eigen::Vector2f corner[3];
    Eigen::Vector3f middle = Eigen::Vector3f::Zero(), normal = Eigen::Vector3f::Zero();
    for (int i = 0; i < 3; ++i) {
      const int v = triangles[t][i];
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
    const float seen =
        depth[static_cast<std::size_t>(at.y()) * camera.width + static_cast<std::size_t>(at.x())];
    if (seen < 0.0f || std::abs(seen - middle.z()) > kDepthTolerance_m) continue;
    const Eigen::Vector2f a = corner[1] - corner[0], b = corner[2] - corner[0];
    const float area = 0.5f * std::abs(a.x() * b.y() - a.y() * b.x());
    out.triangle.push_back(static_cast<int>(t));
    out.size.push_back(problem_.triangle_weight[t] * cosine * cosine * area / area_px);
    out.basis.push_back(sh_basis(normal.x(), normal.y(), normal.z()));
    Eigen::Vector3f lit = Eigen::Vector3f::Zero();
    for (int j = 0; j < 9; ++j) lit += out.basis.back()[j] * problem_.light.coefficients[j];
    out.root_of_light.push_back(lit.cwiseMax(0.01f).cwiseSqrt());
  }
  const Eigen::VectorXd model_x = problem_.layout.model_vector(x, k);
  const Synthesis synthesis{problem_.model.parameters(),    model_x, scene, camera, pixels,
                            rasteriser.projected_vertices()};
  out.contour = find_contour(synthesis, problem_.keyframes[k].observation->levels[level_],
                             problem_.fitter.topology(), problem_.triangle_weight, problem_.contour,
                             contour_options(eye_distance_px(problem_.camera, model_x) * scale));
  return out;
}

std::vector<BundleObjective::Samples> BundleObjective::sample_all(const Eigen::VectorXd& x,
                                                                  bool with_jacobian) const {
  std::vector<Samples> out(views_.size());
  parallel_for(out.size(), [&](std::size_t k) { out[k] = sample(x, k, with_jacobian); });
  return out;
}

BundleObjective::Samples BundleObjective::sample(const Eigen::VectorXd& x, std::size_t k,
                                                 bool with_jacobian) const {
  const View& view = views_[k];
  const ObservationLevel& level = problem_.keyframes[k].observation->levels[level_];
  const Eigen::VectorXf own_light = problem_.layout.light(x, k).cast<float>();
  Scene scene;
  problem_.model.synthesize(problem_.layout.model_vector(x, k), scene);
  const PointsF& positions = scene.objects[0].positions_m;
  const Projection project(camera(k));
  const Eigen::Vector2f last(static_cast<float>(level.width) - 1.01f,
                             static_cast<float>(level.height) - 1.01f);
  Samples out;
  std::vector<float> slopes;  // derivative of the albedo by the pixel, x and y in turn
  for (std::size_t i = 0; i < view.triangle.size(); ++i) {
    const auto& corner =
        problem_.fitter.topology().triangles[static_cast<std::size_t>(view.triangle[i])];
    const Eigen::Vector3f middle = project.camera_point(
        (positions.row(corner[0]) + positions.row(corner[1]) + positions.row(corner[2])) / 3.0f);
    const Colour colour = sample_colour(level, project.pixel(middle).cwiseMax(1.0f).cwiseMin(last));
    const Eigen::Map<const Eigen::VectorXf> basis(view.basis[i].data(), BundleLayout::light_size);
    const Eigen::Vector3f root = std::exp(basis.dot(own_light)) * view.root_of_light[i];
    const Eigen::Vector3f grey = (3.0f * root).cwiseInverse();
    out.albedo.push_back(grey.dot(colour.value));
    slopes.push_back(grey.dot(colour.dx));
    slopes.push_back(grey.dot(colour.dy));
    out.encoded.push_back(colour.value);
    out.root_of_light.push_back(root);
    const float noise = static_cast<float>(sigma_) / root.mean();
    out.weight.push_back(view.size[i] / (noise * noise));
  }
  if (with_jacobian) {
    differentiate(x, k, positions, slopes, out);
  } else {
    compare_contour(k, positions, nullptr, out.contour);
  }
  return out;
}

void BundleObjective::differentiate(const Eigen::VectorXd& x, std::size_t k,
                                    const PointsF& positions, const std::vector<float>& slopes,
                                    Samples& out) const {
  const View& view = views_[k];
  const Eigen::VectorXd model_x = problem_.layout.model_vector(x, k);
  const Projection project(camera(k));
  std::vector<int> vertices(static_cast<std::size_t>(positions.rows()));
  std::iota(vertices.begin(), vertices.end(), 0);
  std::vector<ImageFromWorld> image_from_world;
  for (int v : vertices) {
    image_from_world.push_back(project.derivative(project.camera_point(positions.row(v))));
  }
  const Eigen::Index size = problem_.model.parameters().tangent_size();
  std::vector<int> columns(static_cast<std::size_t>(size));
  std::iota(columns.begin(), columns.end(), 0);
  VertexJacobian motion(2 * static_cast<Eigen::Index>(vertices.size()),
                        SurfaceEquations::padded_columns(size));
  problem_.model.image_jacobian(model_x, columns, vertices, image_from_world, motion);
  compare_contour(k, positions, &motion, out.contour);
  out.jacobian.setZero(static_cast<Eigen::Index>(view.triangle.size()),
                       size + BundleLayout::light_size);
  for (std::size_t i = 0; i < view.triangle.size(); ++i) {
    auto row = out.jacobian.row(static_cast<Eigen::Index>(i));
    const auto triangle = static_cast<std::size_t>(view.triangle[i]);
    for (int v : problem_.fitter.topology().triangles[triangle]) {
      row.head(size) += slopes[2 * i] / 3.0f * motion.row(2 * v).head(size) +
                        slopes[2 * i + 1] / 3.0f * motion.row(2 * v + 1).head(size);
    }
  }
}

void BundleObjective::compare_contour(std::size_t k, const PointsF& positions,
                                      const VertexJacobian* motion, NormalEquations& out) const {
  const Projection project(camera(k));
  const Eigen::Index size = problem_.model.parameters().tangent_size();
  out.reset(motion != nullptr ? size : 0);
  for (const ContourTarget& target : views_[k].contour) {
    const auto& corner =
        problem_.fitter.topology().triangles[static_cast<std::size_t>(target.triangle)];
    Eigen::Vector2f seen = Eigen::Vector2f::Zero();
    for (int i = 0; i < 3; ++i) {
      seen += target.barycentric[i] * project.pixel(project.camera_point(positions.row(corner[i])));
    }
    const ContourTarget::Loss loss = target.loss(seen);
    out.cost += loss.cost;
    if (motion == nullptr) continue;
    Eigen::VectorXd derivative = Eigen::VectorXd::Zero(size);
    for (int i = 0; i < 3; ++i) {
      for (int axis = 0; axis < 2; ++axis) {
        derivative += (target.barycentric[i] * target.normal[axis] *
                       motion->row(2 * corner[i] + axis).head(size))
                          .transpose()
                          .cast<double>();
      }
    }
    out.gradient += loss.slope * derivative;
    out.hessian.selfadjointView<Eigen::Lower>().rankUpdate(derivative, loss.curvature);
  }
  out.hessian.triangularView<Eigen::StrictlyUpper>() = out.hessian.transpose();
}

/// Six rounds of reweighting with Geman-McClure's weights.
void BundleObjective::robust_mean(const std::vector<Sighting>& seen,
                                  const std::vector<Samples>& samples, Mean& out) const {
  const double cut = std::max(sigma_ * kRobustWidth, kLeastCut);
  const auto albedo = [&](std::size_t s) { return samples[seen[s].view].albedo[seen[s].index]; };
  // Outliers are judged by what is seen: darkening a keyframe until its albedo is one must not pay.
  const auto root = [&](std::size_t s) {
    return samples[seen[s].view].root_of_light[seen[s].index].mean();
  };
  const auto full = [&](std::size_t s) { return samples[seen[s].view].weight[seen[s].index]; };
  out.weight.resize(seen.size());
  for (std::size_t s = 0; s < seen.size(); ++s) out.weight[s] = full(s);
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    double sum = 0.0;
    out.total_weight = 0.0;
    for (std::size_t s = 0; s < seen.size(); ++s) {
      sum += out.weight[s] * albedo(s);
      out.total_weight += out.weight[s];
    }
    out.value = sum / out.total_weight;
    out.cost = 0.0;
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const double r = albedo(s) - out.value;
      const double shown = root(s) * r / cut;
      const double q = 1.0 / (1.0 + shown * shown);
      // The last mean must belong to the last weights: the marginal rests on it.
      if (round + 1 < kRounds) out.weight[s] = full(s) * q * q;
      out.cost += 0.5 * full(s) * q * r * r;
    }
  }
}

double BundleObjective::albedo_term(std::vector<Samples>& samples, NormalEquations* out) const {
  double cost = 0.0;
  Mean mean;
  if (out == nullptr) {
    for (const auto& seen : sightings_) {
      robust_mean(seen, samples, mean);
      cost += mean.cost;
    }
    return cost;
  }
  const Eigen::Index size = space().tangent_size();
  std::vector<std::vector<Eigen::Index>> tangent;
  std::vector<Eigen::VectorXf> weight, residual;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    tangent.push_back(problem_.layout.tangent(k));
    weight.emplace_back(Eigen::VectorXf::Zero(samples[k].jacobian.rows()));
    residual.push_back(weight.back());
  }
  // Row per triangle: sum over the keyframes of weight * derivative, over the root of the sum of
  // weights. Its outer product is what the free albedo takes away.
  Rows coupling = Rows::Zero(static_cast<Eigen::Index>(sightings_.size()), size);
  for (std::size_t row = 0; row < sightings_.size(); ++row) {
    const auto& seen = sightings_[row];
    robust_mean(seen, samples, mean);
    cost += mean.cost;
    const double scale = 1.0 / std::sqrt(std::max(mean.total_weight, 1e-30));
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const auto [k, index] = seen[s];
      const auto i = static_cast<Eigen::Index>(index);
      weight[k][i] = static_cast<float>(mean.weight[s]);
      residual[k][i] = static_cast<float>(samples[k].albedo[index] - mean.value);
      // What light changes in the image is its product with the mean. With the view's own albedo,
      // whose noise is that of the residual, more light would always seem to pay.
      samples[k].jacobian.row(i).tail<BundleLayout::light_size>() =
          -static_cast<float>(mean.value) *
          Eigen::Map<const Eigen::RowVectorXf>(views_[k].basis[index].data(),
                                               BundleLayout::light_size);
      const auto w = static_cast<float>(mean.weight[s] * scale);
      float* target = coupling.row(static_cast<Eigen::Index>(row)).data();
      const float* derivative = samples[k].jacobian.row(i).data();
      for (std::size_t p = 0; p < tangent[k].size(); ++p) {
        target[tangent[k][p]] += w * derivative[p];
      }
    }
  }
  std::vector<Eigen::MatrixXf> hessian(samples.size());
  std::vector<Eigen::VectorXf> gradient(samples.size());
  parallel_for(samples.size(), [&](std::size_t k) {
    const Rows weighted = weight[k].asDiagonal() * samples[k].jacobian;
    hessian[k] = weighted.transpose() * samples[k].jacobian;
    gradient[k] = weighted.transpose() * residual[k];
  });
  Eigen::MatrixXf taken = Eigen::MatrixXf::Zero(size, size);
  taken.selfadjointView<Eigen::Lower>().rankUpdate(coupling.transpose());
  out->hessian -= Eigen::MatrixXf(taken.selfadjointView<Eigen::Lower>()).cast<double>();
  for (std::size_t k = 0; k < samples.size(); ++k) {
    out->hessian(tangent[k], tangent[k]) += hessian[k].cast<double>();
    out->gradient(tangent[k]) += gradient[k].cast<double>();
  }
  return cost;
}

/// The keyframes show the same face, so what its colours get wrong they get wrong together: they
/// count as one picture.
double BundleObjective::part_term(const Eigen::VectorXd& x, NormalEquations* out) const {
  std::vector<NormalEquations> parts(problem_.keyframes.size());
  parallel_for(parts.size(), [&](std::size_t k) {
    const Keyframe& keyframe = problem_.keyframes[k];
    parts[k].reset(problem_.model.parameters().tangent_size());
    parts[k].cost = problem_.fitter.compare_parts(
        *keyframe.observation, problem_.camera, problem_.layout.model_vector(x, k), keyframe.marks,
        out != nullptr ? &parts[k] : nullptr);
  });
  const double share = 1.0 / static_cast<double>(parts.size());
  double cost = 0.0;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    cost += share * parts[k].cost;
    if (out == nullptr) continue;
    const std::vector<Eigen::Index> tangent = problem_.layout.model_tangent(k);
    out->hessian(tangent, tangent) += share * parts[k].hessian;
    out->gradient(tangent) += share * parts[k].gradient;
  }
  return cost;
}

double BundleObjective::prior_term(const Eigen::VectorXd& x, NormalEquations* out) const {
  const Eigen::VectorXd information = space().tangent_prior_sigma().cwiseAbs2().cwiseInverse();
  const Eigen::VectorXd away = space().minus(x, space().initial());
  double cost = 0.0;
  for (Eigen::Index i = 0; i < away.size(); ++i) {
    if (!(information[i] > 0.0)) continue;
    cost += 0.5 * information[i] * away[i] * away[i];
    if (out == nullptr) continue;
    out->hessian(i, i) += information[i];
    out->gradient[i] += information[i] * away[i];
  }
  return cost;
}

double BundleObjective::contour_term(const std::vector<Samples>& samples,
                                     NormalEquations* out) const {
  double cost = 0.0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    cost += samples[k].contour.cost;
    if (out == nullptr) continue;
    const std::vector<Eigen::Index> tangent = problem_.layout.model_tangent(k);
    out->hessian(tangent, tangent) += samples[k].contour.hessian;
    out->gradient(tangent) += samples[k].contour.gradient;
  }
  return cost;
}

double BundleObjective::build(const Eigen::VectorXd& x, NormalEquations* out) const {
  std::vector<Samples> samples = sample_all(x, out != nullptr);
  const double cost = albedo_term(samples, out) + contour_term(samples, out) + part_term(x, out) +
                      prior_term(x, out);
  return std::isfinite(cost) ? cost : std::numeric_limits<double>::infinity();
}

double BundleObjective::evaluate(const Eigen::VectorXd& x) const { return build(x, nullptr); }

bool BundleObjective::normal_equations(const Eigen::VectorXd& x, NormalEquations& out) const {
  out.reset(space().tangent_size());
  out.cost = build(x, &out);
  return std::isfinite(out.cost);
}

double BundleObjective::deviation(const Eigen::VectorXd& x) const {
  const std::vector<Samples> samples = sample_all(x, false);
  std::vector<double> magnitude;
  Mean mean;
  for (const auto& seen : sightings_) {
    robust_mean(seen, samples, mean);
    const auto n = static_cast<double>(seen.size());
    for (const Sighting& s : seen) {
      const Samples& view = samples[s.view];
      // A mean of n takes a part 1 / n of the variance with it.
      magnitude.push_back(std::abs(view.albedo[s.index] - mean.value) *
                          view.root_of_light[s.index].mean() * std::sqrt(n / (n - 1.0)));
    }
  }
  if (magnitude.empty()) return sigma_;
  const auto middle = magnitude.begin() + static_cast<std::ptrdiff_t>(magnitude.size() / 2);
  std::nth_element(magnitude.begin(), middle, magnitude.end());
  return std::clamp(1.4826 * *middle, kLeastSigma, kLargestSigma);
}

std::vector<ShLight> BundleObjective::lights(const Eigen::VectorXd& x) const {
  constexpr double kPull = 0.05;  // towards the common light, relative to the data
  const std::vector<Samples> samples = sample_all(x, false);
  std::vector<LightEquations> equations(samples.size());
  Mean mean;
  for (const auto& seen : sightings_) {
    robust_mean(seen, samples, mean);
    Eigen::Vector3f albedo = Eigen::Vector3f::Zero();  // encoded, in colour
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const Samples& view = samples[seen[s].view];
      albedo += static_cast<float>(mean.weight[s] / mean.total_weight) *
                view.encoded[seen[s].index].cwiseQuotient(view.root_of_light[seen[s].index]);
    }
    for (std::size_t s = 0; s < seen.size(); ++s) {
      const auto [k, i] = seen[s];
      equations[k].add(views_[k].basis[i], albedo.data(), samples[k].encoded[i].data(),
                       mean.weight[s]);
    }
  }
  std::vector<ShLight> out;
  for (const LightEquations& light : equations)
    out.push_back(light.solve(problem_.light, kPull, 2));
  return out;
}

ShLight BundleObjective::common_light(const Eigen::VectorXd& x) const {
  constexpr double kPull = 0.01;
  constexpr double kWidth = 0.2;  // relative to the albedo: farther from it counts a quarter
  const std::vector<Samples> samples = sample_all(x, false);
  ShLight light = problem_.light;
  for (int round = 0; round < 3; ++round) {
    LightEquations equations;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      for (std::size_t i = 0; i < views_[k].triangle.size(); ++i) {
        const GenericColour& colour =
            problem_.colour[static_cast<std::size_t>(views_[k].triangle[i])];
        if (!(colour.confidence > 0.0f)) continue;
        Eigen::Vector3f lit = Eigen::Vector3f::Zero();
        for (int b = 0; b < 9; ++b) lit += views_[k].basis[i][b] * light.coefficients[b];
        const Eigen::Vector3f& observed = samples[k].encoded[i];
        const Eigen::Vector3f expected =
            colour.encoded.cwiseProduct(lit.cwiseMax(1e-4f).cwiseSqrt());
        const double away =
            round == 0 ? 0.0
                       : (observed - expected).norm() / std::max(kWidth * expected.norm(), 1e-6);
        const double q = 1.0 / (1.0 + away * away);
        equations.add(views_[k].basis[i], colour.encoded.data(), observed.data(),
                      colour.confidence * views_[k].size[i] * q * q);
      }
    }
    light = equations.solve(light, kPull, 2);
  }
  return light;
}

}  // namespace semblance
