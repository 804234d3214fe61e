#include <fmt/format.h>

#include <Eigen/Geometry>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "semblance/core/errors.h"
#include "semblance/io/image_io.h"
#include "semblance/io/mesh_io.h"
#include "semblance/models/sweep_file.h"
#include "semblance/render/renderer.h"

namespace semblance::cli {

namespace {

struct SurfaceOptions {
  std::string file, mesh, picture;
  int around = 128, along = 64;
  bool caps = false;
};

/// The surface from a corner and above, filling the picture, lit from the left.
Image surface_picture(const Mesh& mesh) {
  const Eigen::Vector3d low = mesh.positions_m.colwise().minCoeff();
  const Eigen::Vector3d high = mesh.positions_m.colwise().maxCoeff();
  const double radius = 0.5 * (high - low).norm();
  const Eigen::Matrix3d view = (Eigen::AngleAxisd(0.45, Eigen::Vector3d::UnitX()) *
                                Eigen::AngleAxisd(-0.6, Eigen::Vector3d::UnitY()))
                                   .toRotationMatrix();
  Scene scene;
  SceneObject object;
  object.name = "sweep";
  object.mesh = std::make_shared<Mesh>(mesh);
  // Scaled to a unit radius: a renderer's near plane is in metres.
  const auto centred = mesh.positions_m.rowwise() - (0.5 * (low + high)).transpose();
  object.positions_m = (centred * view.transpose() / radius).cast<float>();
  object.positions_m.col(2).array() -= 3.2f;
  vertex_normals(object.positions_m, mesh.triangles, object.normals);
  object.material.colour = Eigen::Vector3f(0.5f, 0.6f, 0.75f);
  scene.objects.push_back(std::move(object));
  scene.background.setOnes();
  scene.light.coefficients[0].setConstant(0.46f);
  scene.light.coefficients[1].setConstant(0.28f);
  scene.light.coefficients[2].setConstant(0.25f);
  scene.light.coefficients[3].setConstant(-0.3f);
  return downsample_half(make_renderer("osmesa")
                             ->render(scene, Camera::centred(1280, 1280, 1850.0), Channel::colour)
                             .colour);
}

void run_surface(const Context& context, const SurfaceOptions& options) {
  if (!options.picture.empty()) require_image_name(options.picture);
  const SweepSurface surface = read_sweep(options.file);
  const Mesh mesh = surface.mesh(options.around, options.along, options.caps);
  write_mesh(options.mesh, mesh);
  if (!options.picture.empty()) write_image(options.picture, surface_picture(mesh));
  fmt::print("{}: {} contours, {} controls, {} vertices, {} triangles\n", options.mesh,
             surface.contours().size(), surface.controls().size(), mesh.vertex_count(),
             mesh.triangle_count());
  write_summary(context, nlohmann::json{{"contours", surface.contours().size()},
                                        {"controls", surface.controls().size()},
                                        {"vertices", mesh.vertex_count()},
                                        {"triangles", mesh.triangle_count()}}
                             .dump(2));
}

}  // namespace

void add_sweep_surface_command(CLI::App& sweep, Context& context) {
  auto options = std::make_shared<SurfaceOptions>();
  CLI::App* surface =
      sweep.add_subcommand("surface", "Contours carried along a curve and blended into each other");
  surface->add_option("sweep", options->file, "Sweep file (docs/formats/sweep.md)")->required();
  surface->add_option("-o,--output", options->mesh, "Mesh to write, .ply or .obj")->required();
  surface->add_option("--picture", options->picture, "Also draw it to this PNG");
  surface->add_option("--around", options->around, "Vertices around a contour")
      ->check(CLI::Range(3, 16384))
      ->capture_default_str();
  surface->add_option("--along", options->along, "Steps between two contours")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  surface->add_flag("--caps", options->caps, "Close both ends");
  surface->callback([&context, options] {
    context.action = [&context, options] { run_surface(context, *options); };
  });
}

}  // namespace semblance::cli
