#include "semblance/models/contract.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <thread>

#include "semblance/core/random.h"

namespace semblance {
namespace {

class Report {
 public:
  template <class... Parts>
  void expect(bool holds, const Parts&... parts) {
    if (holds) return;
    (text_ << ... << parts) << '\n';
  }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

/// Positions of all vertices, numbered through, or normals.
PointsF joined(const Scene& scene, PointsF SceneObject::*rows) {
  Eigen::Index count = 0;
  for (const SceneObject& object : scene.objects) count += (object.*rows).rows();
  PointsF all(count, 3);
  count = 0;
  for (const SceneObject& object : scene.objects) {
    all.middleRows(count, (object.*rows).rows()) = object.*rows;
    count += (object.*rows).rows();
  }
  return all;
}

PointsF positions_at(const ParametricModel& model, const Eigen::VectorXd& x) {
  Scene scene;
  model.synthesize(x, scene);
  return joined(scene, &SceneObject::positions_m);
}

/// A place inside the bounds: some tangent steps of the usual size away from the start.
Eigen::VectorXd random_place(const ParameterSpace& space, Random& random) {
  Eigen::VectorXd d = random.normal_vector(space.tangent_size());
  d.array() *= space.tangent_scale().array().min(0.5);
  return space.plus(space.initial(), d);
}

std::vector<std::string> tangent_names(const ParameterSpace& space) {
  std::vector<std::string> names;
  for (const ParameterBlock& block : space.blocks()) {
    for (int i = 0; i < ParameterSpace::tangent_size(block); ++i) {
      names.push_back(block.name + "[" + std::to_string(i) + "]");
    }
  }
  return names;
}

void check_finite_at_bounds(const ParametricModel& model, Report& report) {
  const ParameterSpace& space = model.parameters();
  const Eigen::VectorXd start = space.initial();
  const auto check = [&](const Eigen::VectorXd& x, const std::string& where) {
    Scene scene;
    model.synthesize(x, scene);
    report.expect(joined(scene, &SceneObject::positions_m).allFinite(), "positions are not finite ",
                  where);
    report.expect(joined(scene, &SceneObject::normals).allFinite(), "normals are not finite ",
                  where);
  };
  for (const bool upper : {false, true}) {
    Eigen::VectorXd all = start;
    for (std::size_t b = 0; b < space.blocks().size(); ++b) {
      const ParameterBlock& block = space.blocks()[b];
      const Eigen::VectorXd& bound = upper ? block.upper : block.lower;
      if (block.manifold == Manifold::rotation || !bound.allFinite()) continue;
      Eigen::VectorXd one = start;
      one.segment(space.offset(static_cast<int>(b)), block.size) = bound;
      all.segment(space.offset(static_cast<int>(b)), block.size) = bound;
      check(one, "with " + block.name + " at a bound");
    }
    check(all, upper ? "with all at their upper bounds" : "with all at their lower bounds");
  }
}

void check_determinism(const ParametricModel& model, Random& random, Report& report) {
  constexpr int count = 8;
  std::vector<Eigen::VectorXd> xs;
  std::vector<PointsF> expected, threaded(count);
  for (int i = 0; i < count; ++i) {
    xs.push_back(random_place(model.parameters(), random));
    expected.push_back(positions_at(model, xs.back()));
  }
  Scene reused;
  model.synthesize(xs.back(), reused);
  model.synthesize(xs.front(), reused);
  report.expect(joined(reused, &SceneObject::positions_m) == expected.front(),
                "positions depend on what the scene held before");

  std::vector<std::thread> threads;
  for (int i = 0; i < count; ++i) {
    threads.emplace_back([&, i] { threaded[i] = positions_at(model, xs[i]); });
  }
  for (std::thread& thread : threads) thread.join();
  report.expect(threaded == expected, "positions differ when several threads synthesize at once");
}

void check_scene_is_kept(const ParametricModel& model, Report& report) {
  Scene scene;
  model.synthesize(model.parameters().initial(), scene);
  report.expect(!scene.objects.empty(), "the scene is empty");
  const Eigen::Vector3f colour(0.1f, 0.2f, 0.3f);
  scene.background = colour;
  scene.light.coefficients[3] = colour;
  for (SceneObject& object : scene.objects) object.material.colour = colour;
  model.synthesize(model.parameters().initial(), scene);
  bool kept = scene.background == colour && scene.light.coefficients[3] == colour;
  for (const SceneObject& object : scene.objects) kept &= object.material.colour == colour;
  report.expect(kept, "synthesize changes materials, light or background of its own scene");
}

/// What a step of tangent_scale() along each direction does to the positions, by differences.
PointsF central_difference(const ParametricModel& model, const Eigen::VectorXd& x,
                           Eigen::Index column, double step) {
  const ParameterSpace& space = model.parameters();
  const Eigen::VectorXd d = Eigen::VectorXd::Unit(space.tangent_size(), column) * step;
  return (positions_at(model, space.plus(x, d)) - positions_at(model, space.plus(x, -d))) /
         static_cast<float>(2.0 * step);
}

/// A place from which every parameter can go both ways by `part` of its scale.
Eigen::VectorXd inner_place(const ParameterSpace& space, Random& random, double part) {
  Eigen::VectorXd x = random_place(space, random);
  const Eigen::VectorXd scale = space.tangent_scale();
  for (std::size_t b = 0; b < space.blocks().size(); ++b) {
    const ParameterBlock& block = space.blocks()[b];
    if (block.manifold == Manifold::rotation) continue;
    for (int i = 0; i < block.size; ++i) {
      const double margin = part * scale[space.tangent_offset(static_cast<int>(b)) + i];
      double& value = x[space.offset(static_cast<int>(b)) + i];
      value = std::clamp(value, block.lower[i] + margin, block.upper[i] - margin);
    }
  }
  return x;
}

void check_columns(const ParametricModel& model, const Eigen::VectorXd& x,
                   const VertexJacobian& whole, Report& report) {
  const Eigen::Index tangent_size = model.parameters().tangent_size();
  std::vector<int> columns, vertices;
  for (Eigen::Index c = tangent_size - 1; c >= 0; c -= 2) columns.push_back(static_cast<int>(c));
  for (Eigen::Index v = 0; v < whole.rows() / 3; v += 3) vertices.push_back(static_cast<int>(v));
  constexpr float untouched = -77.0f;
  VertexJacobian part =
      VertexJacobian::Constant(whole.rows(), static_cast<Eigen::Index>(columns.size()), untouched);
  model.vertex_jacobian(x, columns, &vertices, part);
  bool same = true, kept = true;
  for (Eigen::Index row = 0; row < whole.rows(); ++row) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const float value = part(row, static_cast<Eigen::Index>(c));
      if (row / 3 % 3 != 0) {
        kept &= value == untouched;
      } else {
        const float full = whole(row, columns[c]);
        same &= std::abs(value - full) <= 1e-5f * (1.0f + std::abs(full));
      }
    }
  }
  report.expect(same, "the Jacobian of some columns and vertices differs from the whole");
  report.expect(kept, "the Jacobian writes rows of vertices that were not asked for");
}

/// Against the product of the rows that vertex_jacobian writes, with one column to spare.
void check_image_motion(const ParametricModel& model, const Eigen::VectorXd& x,
                        const std::vector<int>& columns, const VertexJacobian& whole,
                        Random& random, Report& report) {
  std::vector<int> vertices;
  std::vector<ImageFromWorld> image_from_world;
  for (Eigen::Index v = 1; v < whole.rows() / 3; v += 2) {
    vertices.push_back(static_cast<int>(v));
    image_from_world.push_back(
        ImageFromWorld::NullaryExpr([&] { return static_cast<float>(random.uniform(-1.0, 1.0)); }));
  }
  const auto count = static_cast<Eigen::Index>(vertices.size());
  VertexJacobian motion = VertexJacobian::Constant(2 * count, whole.cols() + 1, -77.0f);
  model.image_jacobian(x, columns, vertices, image_from_world, motion);
  bool same = true;
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto rows = whole.middleRows(3 * Eigen::Index{vertices[static_cast<std::size_t>(i)]}, 3);
    const Eigen::MatrixXf expected = image_from_world[static_cast<std::size_t>(i)] * rows;
    const auto found = motion.block(2 * i, 0, 2, whole.cols());
    same &= ((found - expected).array().abs() <= 1e-5f * (1.0f + expected.array().abs())).all();
  }
  report.expect(same, "the image Jacobian is not the projected Jacobian");
  report.expect((motion.rightCols(1).array() == 0.0f).all(),
                "the image Jacobian is not zero past its last parameter");
}

void check_motion(const ParametricModel& model, const ModelAccuracy& accuracy, Random& random,
                  Report& report) {
  // A small part of the scale keeps the differences' own error below the accuracy asked for.
  constexpr double part = 0.05;
  const ParameterSpace& space = model.parameters();
  const Eigen::VectorXd scale = space.tangent_scale();
  const std::vector<std::string> names = tangent_names(space);
  std::vector<int> all_columns;
  for (std::size_t i = 0; i < names.size(); ++i) all_columns.push_back(static_cast<int>(i));
  std::vector<double> most_motion(names.size(), 0.0);
  bool has_jacobian = true;
  for (int point = 0; point < accuracy.points; ++point) {
    const Eigen::VectorXd x = inner_place(space, random, part);
    VertexJacobian jacobian;
    has_jacobian = has_jacobian && model.vertex_jacobian(x, all_columns, nullptr, jacobian);
    if (has_jacobian) {
      check_columns(model, x, jacobian, report);
      check_image_motion(model, x, all_columns, jacobian, random, report);
    }
    for (std::size_t c = 0; c < names.size(); ++c) {
      const PointsF difference =
          central_difference(model, x, static_cast<Eigen::Index>(c), part * scale[c]);
      const double motion_m = scale[c] * difference.rowwise().norm().maxCoeff();
      most_motion[c] = std::max(most_motion[c], motion_m);
      if (!has_jacobian) continue;
      const Eigen::VectorXf column = jacobian.col(static_cast<Eigen::Index>(c));
      const Eigen::Map<const Eigen::VectorXf> expected(difference.data(), difference.size());
      const double error_m = scale[c] * (column - expected).cwiseAbs().maxCoeff();
      report.expect(error_m <= accuracy.relative * motion_m + accuracy.absolute_m,
                    "the Jacobian of ", names[c], " is off by ", error_m, " m for a motion of ",
                    motion_m, " m");
    }
  }
  for (std::size_t c = 0; c < names.size(); ++c) {
    report.expect(most_motion[c] >= accuracy.least_motion_m, names[c], " moves nothing");
  }
}

void check_landmarks(const ParametricModel& model, Report& report) {
  Scene scene;
  model.synthesize(model.parameters().initial(), scene);
  Eigen::Index triangle_count = 0;
  for (const SceneObject& object : scene.objects) triangle_count += object.mesh->triangle_count();
  std::set<std::string> names;
  for (const ModelLandmark& landmark : model.landmarks()) {
    report.expect(names.insert(landmark.name).second, "two landmarks are called ", landmark.name);
    report.expect(landmark.triangle >= 0 && landmark.triangle < triangle_count, "landmark ",
                  landmark.name, " names triangle ", landmark.triangle, " of ", triangle_count);
    float sum = 0.0f, least = 1.0f;
    for (float weight : landmark.barycentric) {
      sum += weight;
      least = std::min(least, weight);
    }
    report.expect(std::abs(sum - 1.0f) < 1e-3f && least >= -1e-4f, "landmark ", landmark.name,
                  " is not inside its triangle");
  }
}

}  // namespace

std::string model_contract_violations(const ParametricModel& model, const ModelAccuracy& accuracy) {
  Report report;
  Random random(1);
  check_finite_at_bounds(model, report);
  check_determinism(model, random, report);
  check_scene_is_kept(model, report);
  check_motion(model, accuracy, random, report);
  check_landmarks(model, report);
  return report.text();
}

}  // namespace semblance
