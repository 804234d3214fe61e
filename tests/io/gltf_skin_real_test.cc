// Skins that others made, against numbers of an independent evaluation.
#include <gmock/gmock.h>

#include <map>
#include <optional>

#include "semblance/io/gltf_skin.h"
#include "support.h"

namespace semblance::testing {
namespace {

using Eigen::RowVector3d;

/// Where a body is at a time; without one, at rest.
struct Shot {
  const char* file;
  std::optional<double> time_s;
  RowVector3d low, high;            // of its bounding box
  RowVector3d one_third, the_last;  // vertices n / 3 and n - 1 of n
};

// By 60 lines of NumPy in double precision, which share nothing with the program: chunks and
// accessors unpacked by hand, rotation matrices from quaternions, slerp by sines, einsum over
// vertices, weights and joints. The files have one skin, one primitive and LINEAR channels.
const Shot shots[] = {
    Shot{"CesiumMan",
         {},
         {-0.131000, 0.000000, -0.569137},
         {0.180954, 1.506550, 0.569137},
         {0.078587, 0.025176, 0.123560},
         {-0.131000, 1.437060, -0.030396}},
    Shot{"CesiumMan",
         0.7,
         {-0.478128, -0.005222, -0.196258},
         {0.446989, 1.474831, 0.234199},
         {-0.410028, 0.158121, 0.146932},
         {-0.096170, 1.405485, -0.013094}},
    Shot{"CesiumMan",
         1.1,
         {-0.454012, -0.022575, -0.239582},
         {0.384875, 1.470049, 0.214392},
         {-0.406457, 0.208513, 0.179715},
         {-0.051679, 1.430327, 0.030482}},
    Shot{"CesiumMan",
         9.0,
         {-0.451214, -0.008301, -0.194339},
         {0.461872, 1.441551, 0.301815},
         {0.230670, 0.019504, 0.151761},
         {-0.038474, 1.403162, 0.065654}},
    Shot{"RiggedFigure",
         {},
         {-0.589461, 0.000000, -0.130918},
         {0.589461, 1.449920, 0.194977},
         {0.042030, 1.188080, 0.042030},
         {-0.058385, 0.000000, 0.177900}},
    Shot{"RiggedFigure",
         0.7,
         {-0.475724, 0.000000, -0.123842},
         {0.467324, 1.465449, 0.214691},
         {0.042558, 1.183823, 0.047720},
         {-0.058381, 0.000001, 0.177901}},
    Shot{"RiggedFigure",
         1.1,
         {-0.563382, 0.000000, -0.129164},
         {0.560728, 1.454759, 0.200201},
         {0.042169, 1.186999, 0.043629},
         {-0.058381, 0.000001, 0.177901}},
    Shot{"RiggedFigure",
         9.0,
         {-0.589461, 0.000000, -0.130920},
         {0.589463, 1.449920, 0.194981},
         {0.042030, 1.188080, 0.042029},
         {-0.058381, 0.000001, 0.177901}},
    Shot{"RiggedSimple",
         {},
         {-1.000000, -4.575077, -1.000000},
         {1.000000, 4.575077, 1.000000},
         {0.000000, 0.000000, -0.489385},
         {0.087806, 4.575077, 0.441431}},
    Shot{"RiggedSimple",
         0.7,
         {-1.000000, -4.575077, -2.174498},
         {1.000000, 4.407588, 1.000000},
         {0.000000, -0.046249, -0.479431},
         {0.087806, 4.404262, -1.351552}},
    Shot{"RiggedSimple",
         1.1,
         {-1.000000, -4.575077, -2.834225},
         {1.000000, 4.118933, 1.000000},
         {0.000000, -0.064408, -0.469628},
         {0.087806, 4.114295, -2.081764}},
    Shot{"RiggedSimple",
         9.0,
         {-1.000000, -4.575077, -1.000000},
         {1.000000, 4.575077, 1.000000},
         {0.000000, 0.000000, -0.489385},
         {0.087806, 4.575077, 0.441431}},
};

TEST(GltfSkinFiles, AreWhereAnIndependentEvaluationPutsThem) {
  for (const Shot& shot : shots) {
    const std::string file = std::string("body/gltf/") + shot.file + ".glb";
    SEMBLANCE_NEED_DATA(file);
    const SkinnedMesh skin = read_gltf_skin(data_path(file).string());
    ASSERT_EQ(skin.animations.size(), 1u);
    const auto positions_m = skinned_positions(
        skin, shot.time_s ? animated_pose(skin.nodes, skin.animations[0], *shot.time_s)
                          : rest_pose(skin.nodes));
    const std::string where = file + " at " + std::to_string(shot.time_s.value_or(-1.0)) + " s";
    const Eigen::Index n = positions_m.rows();
    constexpr double tolerance_m = 2e-6;
    EXPECT_LT((positions_m.colwise().minCoeff() - shot.low).norm(), tolerance_m) << where;
    EXPECT_LT((positions_m.colwise().maxCoeff() - shot.high).norm(), tolerance_m) << where;
    EXPECT_LT((positions_m.row(n / 3) - shot.one_third).norm(), tolerance_m) << where;
    EXPECT_LT((positions_m.row(n - 1) - shot.the_last).norm(), tolerance_m) << where;
  }
}

/// The walking man's surface is closed once his texture's seams are.
TEST(GltfSkinFiles, TheManIsClosedWithoutHisSeams) {
  SEMBLANCE_NEED_DATA("body/gltf/CesiumMan.glb");
  const SkinnedMesh man =
      without_seams(read_gltf_skin(data_path("body/gltf/CesiumMan.glb").string()));
  std::map<std::pair<int, int>, int> uses;
  for (Eigen::Index t = 0; t < man.mesh.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      ++uses[{man.mesh.triangles(t, k), man.mesh.triangles(t, (k + 1) % 3)}];
    }
  }
  int open_edges = 0;
  for (const auto& [edge, count] : uses) {
    open_edges += uses.count({edge.second, edge.first}) == 0 ? 1 : 0;
  }
  EXPECT_EQ(open_edges, 0);
  EXPECT_EQ(man.mesh.vertex_count(), 2338);  // different places in the file
  EXPECT_EQ(man.mesh.triangle_count(), 4672);
}

}  // namespace
}  // namespace semblance::testing
