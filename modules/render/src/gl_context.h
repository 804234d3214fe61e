// An OpenGL 4.5 core context without a window. Where it comes from is this class's affair alone:
// OSMesa, or EGL's surfaceless platform now that Mesa has dropped OSMesa.
#pragma once

#include <memory>

namespace semblance {

class GlContext {
 public:
  virtual ~GlContext() = default;
  /// Makes the calling thread's GL calls go to this context.
  virtual void make_current() = 0;
  /// Address of a GL function, null if there is none of that name.
  virtual void* function(const char* name) const = 0;
};

using GlContextMaker = std::unique_ptr<GlContext> (*)();

/// Null where the maker finds no such context on this machine.
std::unique_ptr<GlContext> make_osmesa_context();
std::unique_ptr<GlContext> make_egl_context();

/// From the first maker that has one. Throws SolverError if none has.
std::unique_ptr<GlContext> make_gl_context();

}  // namespace semblance
