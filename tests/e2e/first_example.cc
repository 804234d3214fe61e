#include <semblance/io/image_io.h>
#include <semblance/models/face.h>
#include <semblance/render/renderer.h>

int main() {
  using namespace semblance;
  const MorphModel face(make_sweep_face());
  const ParameterSpace& space = face.parameters();
  Eigen::VectorXd x = space.initial();
  x[space.offset(space.block_index("jaw_open"))] = 0.4;
  x[space.offset(space.block_index("mouth_smile_left"))] = 0.8;
  Scene scene;
  face.synthesize(x, scene);
  scene.light.coefficients[1].setConstant(0.3f);  // from above
  scene.light.coefficients[2].setConstant(0.6f);  // and from the front
  scene.light.coefficients[0].setConstant(0.2f);
  Camera camera = Camera::centred(480, 480, 800.0);
  camera.camera_from_world.translation_m.z() += 0.6;
  write_image("face.png", make_renderer("osmesa")->render(scene, camera, Channel::colour).colour);
}
