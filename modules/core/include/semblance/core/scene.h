// What a renderer draws.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "semblance/core/image.h"
#include "semblance/core/mesh.h"

namespace semblance {

/// Distant light on a Lambertian surface as second-order spherical harmonics: reflected radiance
/// = albedo * sum_k coefficients[k] * basis_k(normal), with the normal in the world frame and the
/// basis of `sh_basis`. (Ramamoorthi and Hanrahan 2001; the cosine lobe and 1/pi are folded in.)
struct ShLight {
  std::array<Eigen::Vector3f, 9> coefficients;  // linear RGB each

  ShLight() {
    coefficients.fill(Eigen::Vector3f::Zero());
    coefficients[0].setOnes();
  }
};

/// The nine polynomials 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2 of a unit normal. Unnormalised, so
/// that a light with coefficients (1, 0, ..., 0) shows the albedo unchanged.
inline std::array<float, 9> sh_basis(float x, float y, float z) {
  return {1.0f, y, z, x, x * y, y * z, 3.0f * z * z - 1.0f, x * z, x * x - y * y};
}

/// Lambertian surface: albedo from the texture where there is one (bilinear, clamped at the
/// border), else `colour`.
struct Material {
  Eigen::Vector3f colour = Eigen::Vector3f::Constant(0.7f);
  std::shared_ptr<const Image> texture;  // linear RGB, may be null
};

/// A mesh in the scene. Topology and uvs are shared and never change; positions do.
struct SceneObject {
  std::string name;
  std::shared_ptr<const Mesh> mesh;  // triangles and uvs; its positions are the rest shape
  PointsF positions_m;               // world frame, one row per vertex of `mesh`
  PointsF normals;                   // unit, world frame
  Material material;
};

/// Triangles are numbered through: those of the first object first, then those of the second.
struct Scene {
  std::vector<SceneObject> objects;
  ShLight light;
  Eigen::Vector3f background = Eigen::Vector3f::Zero();
};

}  // namespace semblance
