// A fabric like cotton broadcloth, for tests that change one thing about it.
#pragma once

#include "semblance/cloth/fabric.h"

namespace semblance::testing {

inline Fabric plausible_fabric() {
  Fabric fabric;
  fabric.name = "plausible";
  fabric.area_density_kg_m2 = 0.12;
  fabric.thickness_m = 3e-4;
  fabric.friction = 0.3;
  fabric.mass_damping_1_s = 0.1;
  fabric.tension = {linear_response(9e3, 0.05), linear_response(6e3, 0.08)};
  fabric.shear = linear_response(60.0, 0.14, 0.8);
  fabric.bending = {linear_response(1.2e-5, 250.0, 4e-4), linear_response(0.8e-5, 250.0, 2e-4)};
  return fabric;
}

}  // namespace semblance::testing
