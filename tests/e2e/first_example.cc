#include <semblance/io/image_io.h>
#include <semblance/models/face.h>
#include <semblance/render/renderer.h>

int main() {
  using namespace semblance;
  const MorphModel face(make_sweep_face());
  Eigen::VectorXd x = face.parameters().initial();
  const auto set = [&](const char* name, double value) {
    x[face.parameters().offset(face.parameters().block_index(name))] = value;
  };
  set("jaw_open", 0.4);
  set("mouth_smile_left", 0.8);
  Scene scene;
  face.synthesize(x, scene);
  Camera camera = Camera::centred(480, 480, 800.0);
  camera.camera_from_world.translation_m.z() += 0.6;
  write_image("face.png", make_renderer("osmesa")->render(scene, camera, Channel::colour).colour);
}
