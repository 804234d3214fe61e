#include "semblance/cost/contour.h"

#include <gmock/gmock.h>

#include <map>

#include "semblance/cost/contract.h"
#include "semblance/models/morph_model.h"
#include "semblance/optim/optimizer.h"
#include "semblance/pipeline/synthesis_objective.h"

namespace semblance {
namespace {

constexpr double kRadius_m = 0.1, kDistance_m = 1.0;
const Eigen::Vector3f kSkin(0.5f, 0.3f, 0.2f), kBackground(0.1f, 0.3f, 0.5f);

/// An octahedron whose triangles are halved again and again, its corners on a sphere.
std::shared_ptr<Mesh> make_sphere() {
  std::vector<Eigen::Vector3d> corners = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},
                                          {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  std::vector<Eigen::Vector3i> triangles = {{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2},
                                            {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}};
  for (int round = 0; round < 4; ++round) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [found, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<int>(corners.size()));
      if (is_new) corners.push_back((corners[a] + corners[b]).normalized());
      return found->second;
    };
    std::vector<Eigen::Vector3i> finer;
    for (const Eigen::Vector3i& t : triangles) {
      const int a = middle(t[0], t[1]), b = middle(t[1], t[2]), c = middle(t[2], t[0]);
      finer.insert(finer.end(), {{t[0], a, c}, {a, t[1], b}, {c, b, t[2]}, {a, b, c}});
    }
    triangles = finer;
  }
  auto mesh = std::make_shared<Mesh>();
  mesh->positions_m.resize(static_cast<Eigen::Index>(corners.size()), 3);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    mesh->positions_m.row(static_cast<Eigen::Index>(i)) = kRadius_m * corners[i].transpose();
  }
  mesh->triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    mesh->triangles.row(static_cast<Eigen::Index>(t)) = triangles[t].transpose();
  }
  mesh->uvs.setZero(mesh->vertex_count(), 2);
  return mesh;
}

MorphShape make_shape() {
  MorphShape shape;
  shape.mesh = make_sphere();
  shape.parameters = {scalar_block("growth", "1", -0.5, 0.5, 0.0, 0.1, "radius")};
  shape.fields = {make_field(0, shape.mesh->positions_m.cast<float>())};
  return shape;
}

/// A ball before a camera, and a picture of a ball at another place, drawn from its equation.
struct Ball {
  MorphModel model{make_shape()};
  SurfaceTopology topology = topology_of(model);
  SynthesisWorkspace workspace{model, topology};
  Camera camera = Camera::centred(160, 120, 300.0);
  std::vector<float> weight = std::vector<float>(topology.triangles.size(), 1.0f);
  std::vector<ContourEdge> edges = contour_edges(
      topology, std::vector<float>(static_cast<std::size_t>(topology.vertex_count), 1.0f));
  Eigen::VectorXd x = model.parameters().initial();
  ContourOptions options{8.0, 0.5, 6.0};
  Eigen::Vector2d true_centre_px{84.0, 57.5};

  Ball() { x.segment<3>(4) << 0.0, 0.0, -kDistance_m; }

  /// Radius of the outline of a sphere on the axis: that of the cone of rays that touch it.
  double radius_px() const {
    return camera.focal_px.x() * kRadius_m /
           std::sqrt(kDistance_m * kDistance_m - kRadius_m * kRadius_m);
  }
  Observation picture(const Eigen::Vector3f& background) const {
    Image image(camera.width, camera.height, 3);
    for (int row = 0; row < camera.height; ++row) {
      for (int column = 0; column < camera.width; ++column) {
        const double away = (Eigen::Vector2d(column + 0.5, row + 0.5) - true_centre_px).norm();
        const auto inside = static_cast<float>(std::clamp(radius_px() - away + 0.5, 0.0, 1.0));
        const Eigen::Vector3f colour = inside * kSkin + (1.0f - inside) * background;
        for (int c = 0; c < 3; ++c) {
          image.data[3 * (std::size_t{1} * row * camera.width + column) + c] = colour[c];
        }
      }
    }
    return make_observation(std::move(image), 1);
  }
  SynthesisObjective objective(std::vector<const Cost*> costs, std::vector<int> free = {1}) {
    return {workspace, x, std::move(free), ShLight(), camera, std::move(costs)};
  }
  std::vector<ContourTarget> find(const Observation& observation) {
    std::vector<ContourTarget> out;
    const SynthesisObjective at = objective({});
    at.with_synthesis(at.restrict_to_free(x), [&](const Synthesis& synthesis) {
      out = find_contour(synthesis, observation.levels.front(), topology, weight, edges, options);
    });
    return out;
  }
};

TEST(FindContour, FindsThePictureOfABall) {
  Ball ball;
  const Observation observation = ball.picture(kBackground);
  const std::vector<ContourTarget> targets = ball.find(observation);
  ASSERT_GT(targets.size(), 40u);
  double length = 0.0, bias = 0.0;
  for (const ContourTarget& target : targets) {
    const double away =
        (target.target_px.cast<double>() - ball.true_centre_px).norm() - ball.radius_px();
    EXPECT_LT(std::abs(away), 1.25);  // samples are whole pixels, those on the rim of both colours
    bias += away / static_cast<double>(targets.size());
    EXPECT_NEAR(target.normal.norm(), 1.0, 1e-5);
    length += target.weight * ball.options.correlation_px;
  }
  EXPECT_LT(std::abs(bias), 0.5);
  // All around, once.
  EXPECT_NEAR(length, 2.0 * EIGEN_PI * ball.radius_px(), 0.05 * length);
}

TEST(FindContour, LeavesOutWhatLooksLikeTheSurface) {
  Ball ball;
  EXPECT_THAT(ball.find(ball.picture(kSkin)), ::testing::IsEmpty());
}

TEST(FindContour, LeavesOutWhatLeavesThePicture) {
  Ball ball;
  ball.x[4] = 0.25;  // the right half of the ball is outside
  for (const ContourTarget& target : ball.find(ball.picture(kBackground))) {
    EXPECT_LT(target.target_px.x(), ball.camera.width);
  }
}

TEST(ContourCost, MovesTheBallToItsPicture) {
  Ball ball;
  const Observation observation = ball.picture(kBackground);
  OptimizerOptions options;
  options.max_iterations = 10;
  for (int round = 0; round < 4; ++round) {
    const ContourCost cost(ball.find(observation), &ball.topology);
    const SynthesisObjective objective = ball.objective({&cost});
    const Solution solution =
        make_optimizer("lm", options)
            ->minimize(objective, objective.restrict_to_free(ball.x), silent_progress());
    ball.x = objective.full(solution.x);
  }
  const Eigen::Vector2d seen = project_world(ball.camera, Eigen::Vector3d(ball.x.segment<3>(4)));
  EXPECT_NEAR(seen.x(), ball.true_centre_px.x(), 0.2);
  EXPECT_NEAR(seen.y(), ball.true_centre_px.y(), 0.2);
  // Half a pixel of 30 in radius is 1.6 percent of the distance.
  EXPECT_NEAR(-ball.x[6], kDistance_m, 0.016);
}

TEST(ContourCost, KeepsTheContract) {
  Ball ball;
  const Observation observation = ball.picture(kBackground);
  const ContourCost cost(ball.find(observation), &ball.topology);
  const SynthesisObjective objective = ball.objective({&cost}, {0, 1, 2});
  Eigen::VectorXd turned = ball.x, nearer = ball.x;
  turned.head<4>() << std::cos(0.1), 0.0, std::sin(0.1), 0.0;
  nearer[6] += 0.05;
  const std::vector<Eigen::VectorXd> points{ball.x, turned, nearer};
  const SynthesisAt synthesis_at = [&](const Eigen::VectorXd& x,
                                       const std::function<void(const Synthesis&)>& use) {
    objective.with_synthesis(x, use);
  };
  EXPECT_COST_CONTRACT(cost, ball.topology, objective.space(), synthesis_at, points, {});
}

TEST(ContourEdges, AreThoseOfWeightOnly) {
  Ball ball;
  EXPECT_EQ(ball.edges.size(), static_cast<std::size_t>(ball.topology.edge_count));
  std::vector<float> weight(static_cast<std::size_t>(ball.topology.vertex_count), 0.0f);
  for (int corner : ball.topology.triangles.front())
    weight[static_cast<std::size_t>(corner)] = 1.0f;
  EXPECT_THAT(contour_edges(ball.topology, weight), ::testing::IsEmpty());
}

}  // namespace
}  // namespace semblance
