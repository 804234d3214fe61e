#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "bundle_objective.h"
#include "face_parts.h"
#include "semblance/core/random.h"
#include "semblance/core/rigid3.h"
#include "semblance/models/face.h"
#include "semblance/render/renderer.h"

namespace semblance {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

/// Ray-traced pictures of one head with freckles, turned to several sides, with the truth.
class BundleTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    model_ = new MorphModel(make_sweep_face());
    fitter_ = new FaceFitter(*model_);
    camera_ = Camera::centred(320, 240, 330.0);
    const ParameterSpace& space = model_->parameters();
    Eigen::VectorXd head = space.initial();
    for (const char* name : {"nose_protrusion", "mandible_width", "eye_depth"}) {
      for (std::size_t b = 0; b < space.blocks().size(); ++b) {
        if (space.blocks()[b].name == name) {
          head[space.offset(static_cast<int>(b))] =
              space.blocks()[b].prior_mean[0] + 1.2 * space.blocks()[b].prior_sigma[0];
        }
      }
    }
    const auto texture = std::make_shared<const Image>(freckles());
    for (double yaw : {0.0, 16.0, -18.0, 30.0}) {
      Eigen::VectorXd x = head;
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(yaw * kDegree, Eigen::Vector3d::UnitY()));
      set_pose(space, camera_, {160.0, 105.0}, 42.0, turn, x);
      truth_.push_back(x);
      Scene scene;
      model_->synthesize(x, scene);
      scene.objects[0].material.texture = texture;
      Image picture = make_renderer("embree")->render(scene, camera_, Channel::colour).colour;
      keyframes_.push_back({static_cast<int>(keyframes_.size()),
                            x,
                            std::make_shared<const Observation>(make_observation(picture, 3)),
                            {}});
    }
  }
  static void TearDownTestSuite() {
    delete fitter_;
    delete model_;
    keyframes_.clear();
    truth_.clear();
  }

  /// Colours of the parts, mottled so that every place can be told from its neighbours.
  static Image freckles() {
    Image texture =
        Appearance(*model_->shape().mesh, 512, vertex_albedo(model_->shape()),
                   std::vector<float>(
                       static_cast<std::size_t>(model_->shape().mesh->vertex_count()), 1.0f))
            .texture();
    for (int y = 0; y < texture.height; ++y) {
      for (int x = 0; x < texture.width; ++x) {
        const double u = 2.0 * std::numbers::pi * x / texture.width;
        const double v = 2.0 * std::numbers::pi * y / texture.height;
        const double mottle = 0.8 + 0.2 * std::sin(9 * u + 2 * std::sin(3 * v)) *
                                        std::sin(8 * v + 2 * std::sin(4 * u));
        for (int c = 0; c < 3; ++c) {
          texture.data[3 * (static_cast<std::size_t>(y) * texture.width + x) + c] *=
              static_cast<float>(0.7 * mottle);
        }
      }
    }
    return texture;
  }

  /// Starts as a tracker with the average head would leave them: turned heads are off.
  static std::vector<Keyframe> disturbed() {
    std::vector<Keyframe> out = keyframes_;
    const ParameterSpace& space = model_->parameters();
    const Eigen::Index identities = model_->shape().identity_count;
    const double yaw_deg[] = {0.0, -3.0, 2.5, -4.0};
    for (std::size_t k = 0; k < out.size(); ++k) {
      out[k].x.segment(7, identities) = space.initial().segment(7, identities);
      Eigen::VectorXd d = Eigen::VectorXd::Zero(space.tangent_size());
      d[1] = yaw_deg[k] * kDegree;
      out[k].x = space.plus(out[k].x, d);
    }
    return out;
  }

  static Eigen::Quaterniond rotation(const Eigen::VectorXd& x) {
    return Eigen::Quaterniond(x[0], x[1], x[2], x[3]);
  }
  /// Largest error of the rotation from the first keyframe to another.
  template <typename GetX>
  static double turn_error_deg(const GetX& x_of) {
    double largest = 0.0;
    for (std::size_t k = 1; k < truth_.size(); ++k) {
      const Eigen::Quaterniond found = rotation(x_of(k)) * rotation(x_of(0)).conjugate();
      const Eigen::Quaterniond true_turn = rotation(truth_[k]) * rotation(truth_[0]).conjugate();
      largest = std::max(largest, found.angularDistance(true_turn) / kDegree);
    }
    return largest;
  }

  static MorphModel* model_;
  static FaceFitter* fitter_;
  static Camera camera_;
  static std::vector<Keyframe> keyframes_;
  static std::vector<Eigen::VectorXd> truth_;
};

MorphModel* BundleTest::model_ = nullptr;
FaceFitter* BundleTest::fitter_ = nullptr;
Camera BundleTest::camera_;
std::vector<Keyframe> BundleTest::keyframes_;
std::vector<Eigen::VectorXd> BundleTest::truth_;

TEST_F(BundleTest, ShapeRestsOnTheFaceThatHairCannotCover) {
  const SurfaceTopology& topology = fitter_->topology();
  const std::vector<float> bare = bare_face_weight(model_->shape(), topology);
  const std::vector<float> all = triangle_weights(model_->shape(), topology, tracking_weight);
  int hair = 0, brow_to_chin = 0;
  for (std::size_t t = 0; t < bare.size(); ++t) {
    EXPECT_LE(bare[t], all[t]);
    for (int v : topology.triangles[t]) {
      const double y = model_->shape().mesh->positions_m(v, 1);
      const bool is_hair = static_cast<FacePart>(model_->shape().part[v]) == FacePart::hair;
      if (!is_hair && y < 0.07) continue;
      EXPECT_EQ(bare[t], 0.0f) << "at height " << y;
      ++hair;
      break;
    }
    double top = -1.0;
    bool skin = true;
    for (int v : topology.triangles[t]) {
      top = std::max(top, model_->shape().mesh->positions_m(v, 1));
      skin = skin && static_cast<FacePart>(model_->shape().part[v]) == FacePart::skin;
    }
    if (!skin || top > 0.03) continue;
    EXPECT_EQ(bare[t], all[t]) << "at height " << top;
    ++brow_to_chin;
  }
  EXPECT_GT(hair, 500);
  EXPECT_GT(brow_to_chin, 1000);
}

TEST_F(BundleTest, LayoutPutsEveryEntryInOnePlace) {
  const int identities = model_->shape().identity_count;
  const BundleLayout layout(model_->parameters(), identities, 4);
  const Eigen::VectorXd x = layout.join(truth_);
  ASSERT_EQ(x.size(), layout.space.size());
  std::vector<int> uses(static_cast<std::size_t>(layout.space.tangent_size()), 0);
  for (std::size_t k = 0; k < truth_.size(); ++k) {
    EXPECT_EQ(layout.model_vector(x, k), truth_[k]);
    for (Eigen::Index entry : layout.tangent(k)) ++uses[static_cast<std::size_t>(entry)];
  }
  for (std::size_t entry = 0; entry < uses.size(); ++entry) {
    EXPECT_EQ(uses[entry], entry < static_cast<std::size_t>(identities) ? 4 : 1) << entry;
  }
}

TEST_F(BundleTest, LayoutMovesTheEntriesItNames) {
  const BundleLayout layout(model_->parameters(), model_->shape().identity_count, 4);
  const Eigen::VectorXd x = layout.join(truth_);
  Random random(3);
  for (std::size_t k = 0; k < truth_.size(); ++k) {
    const Eigen::VectorXd step = 1e-3 * random.normal_vector(model_->parameters().tangent_size());
    Eigen::VectorXd whole = Eigen::VectorXd::Zero(layout.space.tangent_size());
    const std::vector<Eigen::Index> tangent = layout.tangent(k);
    for (Eigen::Index i = 0; i < step.size(); ++i) whole[tangent[i]] = step[i];
    const Eigen::VectorXd moved = layout.model_vector(layout.space.plus(x, whole), k);
    EXPECT_LT((moved - model_->parameters().plus(truth_[k], step)).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST_F(BundleTest, GradientIsThatOfTheCost) {
  const BundleLayout layout(model_->parameters(), model_->shape().identity_count, 4);
  const std::vector<float> weight =
      triangle_weights(model_->shape(), fitter_->topology(), tracking_weight);
  const std::vector<Keyframe> keyframes = disturbed();
  std::vector<Eigen::VectorXd> starts;
  for (const Keyframe& keyframe : keyframes) starts.push_back(keyframe.x);
  const std::vector<ContourEdge> contour =
      contour_edges(fitter_->topology(), contour_weight(model_->shape()));
  const std::vector<GenericColour> colour = generic_colours(model_->shape(), fitter_->topology());
  const BundleProblem problem{*fitter_, *model_,   weight,    contour, colour,
                              camera_,  ShLight(), keyframes, layout};
  const Eigen::VectorXd x = layout.join(starts);
  // So small that the albedos outweigh the parts, whose cost has steps where pixels change sides.
  const double sigma = 0.003;
  const BundleObjective objective(problem, 0, x, sigma);
  NormalEquations equations;
  ASSERT_TRUE(objective.normal_equations(x, equations));
  EXPECT_NEAR(equations.cost, objective.evaluate(x), 1e-6 * equations.cost);
  // Along the parts of the gradient of poses, lights and identity; expressions rest on bounds. The
  // derivatives of a picture are central differences over two pixels, a few percent less steep than
  // the picture between its pixels.
  Eigen::VectorXd poses = Eigen::VectorXd::Zero(equations.gradient.size()), lights = poses;
  for (std::size_t k = 0; k < 4; ++k) {
    const std::vector<Eigen::Index> tangent = layout.tangent(k);
    for (std::size_t i = 0; i < 6; ++i) poses[tangent[i]] = 1.0;
    for (std::size_t i = 1; i <= BundleLayout::light_size; ++i) {
      lights[tangent[tangent.size() - i]] = 1.0;
    }
  }
  Eigen::VectorXd identity = Eigen::VectorXd::Zero(equations.gradient.size());
  identity.head(layout.identity_size).setOnes();
  const Eigen::VectorXd scale = equations.hessian.diagonal().cwiseMax(1e-9).cwiseInverse();
  for (const Eigen::VectorXd& part : {poses, lights, identity}) {
    const Eigen::VectorXd direction = part.cwiseProduct(scale).cwiseProduct(equations.gradient);
    const double h = 0.002;
    const double up = objective.evaluate(layout.space.plus(x, h * direction));
    const double down = objective.evaluate(layout.space.plus(x, -h * direction));
    const double slope = equations.gradient.dot(direction);
    EXPECT_GT(slope, 0.0);
    EXPECT_NEAR((up - down) / (2.0 * h), slope, 0.08 * slope);
  }
}

TEST_F(BundleTest, FindsTurnsAndDepthThatTheStartsHaveWrong) {
  const std::vector<Keyframe> keyframes = disturbed();
  const double before = turn_error_deg([&](std::size_t k) { return keyframes[k].x; });
  const FaceBundle bundle = adjust_bundle(*fitter_, *model_, camera_, keyframes);
  const double after = turn_error_deg([&](std::size_t k) { return bundle.x[k]; });
  EXPECT_NEAR(before, 4.0, 1e-6);
  EXPECT_LT(after, 0.8);
  EXPECT_TRUE((bundle.identity_sigma.array() > 0.0).all());
  const ParameterSpace& space = model_->parameters();
  const int nose = space.block_index("nose_protrusion");
  const auto entry = space.offset(nose) - 7;
  const double prior = space.blocks()[static_cast<std::size_t>(nose)].prior_mean[0];
  const double truth = truth_[0][space.offset(nose)];
  // Its prior keeps a part of the way.
  EXPECT_LT(std::abs(bundle.identity[entry] - truth), 0.75 * std::abs(prior - truth));
  for (const Eigen::VectorXd& x : bundle.x) {
    EXPECT_EQ(x.segment(7, bundle.identity.size()), bundle.identity);
  }
}

}  // namespace
}  // namespace semblance
