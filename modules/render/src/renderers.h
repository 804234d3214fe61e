// The makers behind the table in renderer.cc.
#pragma once

#include <memory>

#include "gl_context.h"
#include "semblance/render/renderer.h"

namespace semblance {

std::unique_ptr<Renderer> make_raster_renderer();
std::unique_ptr<Renderer> make_osmesa_renderer();
/// The same renderer on a context of the caller's choice.
std::unique_ptr<Renderer> make_gl_renderer(GlContextMaker make_context);
std::unique_ptr<Renderer> make_embree_renderer();

}  // namespace semblance
