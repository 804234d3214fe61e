// The reference picture: the same scene through OpenGL. Corners are numbered and expanded by the
// vertex shader, which gives every corner its own barycentrics and lets it see the whole triangle.
#include <GL/glcorearb.h>

#include <algorithm>
#include <array>
#include <map>

#include "frame.h"
#include "gl_context.h"
#include "renderers.h"
#include "scene_check.h"
#include "semblance/core/errors.h"

namespace semblance {
namespace {

const char* const vertex_source = R"(#version 450 core
layout(std430, binding = 0) readonly buffer Corners { int corners[]; };        // 3 per triangle
layout(std430, binding = 1) readonly buffer Positions { float positions[]; };  // 3 per vertex
layout(std430, binding = 2) readonly buffer Normals { float normals[]; };      // 3 per vertex
layout(std430, binding = 3) readonly buffer Uvs { float uvs[]; };              // 2 per vertex
uniform mat3 rotation;
uniform vec3 translation;
uniform vec2 focal, principal, size;
uniform bool shaded, textured;
out vec3 barycentric, normal;
out vec2 uv;
out float depth;
flat out int triangle;
const float near = 1e-3;

vec3 camera_position(int vertex) {
  return rotation * vec3(positions[3 * vertex], positions[3 * vertex + 1],
                         positions[3 * vertex + 2]) + translation;
}

void main() {
  triangle = gl_VertexID / 3;
  int corner = gl_VertexID % 3;
  vec3 place = vec3(0);
  bool in_front = true;
  for (int c = 0; c < 3; ++c) {
    vec3 p = camera_position(corners[3 * triangle + c]);
    in_front = in_front && p.z > near;
    if (c == corner) place = p;
  }
  barycentric = vec3(corner == 0, corner == 1, corner == 2);
  int v = corners[3 * triangle + corner];
  normal = shaded ? vec3(normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]) : vec3(0);
  uv = textured ? vec2(uvs[2 * v], uvs[2 * v + 1]) : vec2(0);
  depth = place.z;
  // The image's top row is the framebuffer's first; depth runs from 1 at the near plane to 0.
  vec2 clip = 2.0 * (focal * place.xy + principal * place.z) / size - place.z;
  gl_Position = in_front ? vec4(clip, near, place.z) : vec4(2, 2, 2, 1);
}
)";

const char* const fragment_source = R"(#version 450 core
in vec3 barycentric, normal;
in vec2 uv;
in float depth;
flat in int triangle;
uniform bool textured;
uniform vec3 colour, light[9];
uniform sampler2D albedo;
layout(location = 0) out vec4 out_colour;  // and depth
layout(location = 1) out int out_triangle;
layout(location = 2) out vec4 out_barycentric;
layout(location = 3) out vec4 out_normal;

// Written out because hardware filters round their weights.
vec3 bilinear(vec2 at) {
  ivec2 last = textureSize(albedo, 0) - 1;
  vec2 place = clamp(vec2(at.x, 1.0 - at.y) * vec2(last + 1) - 0.5, vec2(0), vec2(last));
  ivec2 a = ivec2(place), b = min(a + 1, last);
  vec2 w = place - vec2(a);
  return mix(mix(texelFetch(albedo, a, 0).rgb, texelFetch(albedo, ivec2(b.x, a.y), 0).rgb, w.x),
             mix(texelFetch(albedo, ivec2(a.x, b.y), 0).rgb, texelFetch(albedo, b, 0).rgb, w.x),
             w.y);
}

void main() {
  float squared = dot(normal, normal);
  vec3 n = squared > 0.0 ? normal * inversesqrt(squared) : vec3(0);
  vec3 sum = light[0] + light[1] * n.y + light[2] * n.z + light[3] * n.x + light[4] * n.x * n.y +
             light[5] * n.y * n.z + light[6] * (3.0 * n.z * n.z - 1.0) + light[7] * n.x * n.z +
             light[8] * (n.x * n.x - n.y * n.y);
  out_colour = vec4((textured ? bilinear(uv) : colour) * sum, depth);
  out_triangle = triangle;
  out_barycentric = vec4(barycentric, 1.0);
  out_normal = vec4(n, 1.0);
}
)";

/// The GL functions used, fetched from the context so that no GL library is linked.
struct Gl {
#define SEMBLANCE_GL_FUNCTIONS(X)                              \
  X(PFNGLATTACHSHADERPROC, AttachShader)                       \
  X(PFNGLBINDBUFFERBASEPROC, BindBufferBase)                   \
  X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)                 \
  X(PFNGLBINDRENDERBUFFERPROC, BindRenderbuffer)               \
  X(PFNGLBINDTEXTUREPROC, BindTexture)                         \
  X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)                 \
  X(PFNGLBUFFERDATAPROC, BufferData)                           \
  X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus)   \
  X(PFNGLCLEARBUFFERFVPROC, ClearBufferfv)                     \
  X(PFNGLCLEARBUFFERIVPROC, ClearBufferiv)                     \
  X(PFNGLCLIPCONTROLPROC, ClipControl)                         \
  X(PFNGLCOMPILESHADERPROC, CompileShader)                     \
  X(PFNGLCREATEPROGRAMPROC, CreateProgram)                     \
  X(PFNGLCREATESHADERPROC, CreateShader)                       \
  X(PFNGLDELETERENDERBUFFERSPROC, DeleteRenderbuffers)         \
  X(PFNGLDELETESHADERPROC, DeleteShader)                       \
  X(PFNGLDELETETEXTURESPROC, DeleteTextures)                   \
  X(PFNGLDEPTHFUNCPROC, DepthFunc)                             \
  X(PFNGLDISABLEPROC, Disable)                                 \
  X(PFNGLDRAWARRAYSPROC, DrawArrays)                           \
  X(PFNGLDRAWBUFFERSPROC, DrawBuffers)                         \
  X(PFNGLENABLEPROC, Enable)                                   \
  X(PFNGLFRAMEBUFFERRENDERBUFFERPROC, FramebufferRenderbuffer) \
  X(PFNGLGENBUFFERSPROC, GenBuffers)                           \
  X(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)                 \
  X(PFNGLGENRENDERBUFFERSPROC, GenRenderbuffers)               \
  X(PFNGLGENTEXTURESPROC, GenTextures)                         \
  X(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)                 \
  X(PFNGLGETERRORPROC, GetError)                               \
  X(PFNGLGETINTEGERVPROC, GetIntegerv)                         \
  X(PFNGLGETPROGRAMINFOLOGPROC, GetProgramInfoLog)             \
  X(PFNGLGETPROGRAMIVPROC, GetProgramiv)                       \
  X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation)           \
  X(PFNGLLINKPROGRAMPROC, LinkProgram)                         \
  X(PFNGLPIXELSTOREIPROC, PixelStorei)                         \
  X(PFNGLREADBUFFERPROC, ReadBuffer)                           \
  X(PFNGLREADPIXELSPROC, ReadPixels)                           \
  X(PFNGLRENDERBUFFERSTORAGEPROC, RenderbufferStorage)         \
  X(PFNGLSHADERSOURCEPROC, ShaderSource)                       \
  X(PFNGLTEXIMAGE2DPROC, TexImage2D)                           \
  X(PFNGLTEXPARAMETERIPROC, TexParameteri)                     \
  X(PFNGLUNIFORM1IPROC, Uniform1i)                             \
  X(PFNGLUNIFORM2FPROC, Uniform2f)                             \
  X(PFNGLUNIFORM3FVPROC, Uniform3fv)                           \
  X(PFNGLUNIFORMMATRIX3FVPROC, UniformMatrix3fv)               \
  X(PFNGLUSEPROGRAMPROC, UseProgram)                           \
  X(PFNGLVIEWPORTPROC, Viewport)
#define SEMBLANCE_GL_MEMBER(Type, Name) Type Name;
  SEMBLANCE_GL_FUNCTIONS(SEMBLANCE_GL_MEMBER)
#undef SEMBLANCE_GL_MEMBER

  explicit Gl(const GlContext& context) {
#define SEMBLANCE_GL_FETCH(Type, Name) Name = reinterpret_cast<Type>(required(context, "gl" #Name));
    SEMBLANCE_GL_FUNCTIONS(SEMBLANCE_GL_FETCH)
#undef SEMBLANCE_GL_FETCH
#undef SEMBLANCE_GL_FUNCTIONS
  }

 private:
  static void* required(const GlContext& context, const char* name) {
    void* address = context.function(name);
    if (address == nullptr) throw SolverError(std::string("OpenGL has no ") + name);
    return address;
  }
};

enum Target : int { colour_target, triangle_target, barycentric_target, normal_target };
constexpr int target_count = 4;
enum Storage : int { corner_storage, position_storage, normal_storage, uv_storage };
constexpr int storage_count = 4;

class OsmesaRenderer : public Renderer {
 public:
  explicit OsmesaRenderer(GlContextMaker make_context);
  std::string name() const override { return "osmesa"; }
  std::unique_ptr<Renderer> clone() const override {
    return std::make_unique<OsmesaRenderer>(make_context_);
  }
  Frame render(const Scene& scene, const Camera& camera, Channel channels) override;

 private:
  void build_program();
  void set_up_targets(int width, int height, Channel channels);
  void clear(const Scene& scene);
  void upload(const Scene& scene, Channel channels);
  void set_camera(const Camera& camera);
  void draw(const Scene& scene, Channel channels);
  GLuint texture(const std::shared_ptr<const Image>& image);
  void drop_unused_textures(const Scene& scene);
  void read_back(const Camera& camera, Frame& frame);
  void check(const char* what);
  GLint place(const char* uniform) { return gl_.GetUniformLocation(program_, uniform); }
  template <class T>
  const T* read_target(Target target, const Camera& camera, GLenum format, GLenum type,
                       std::vector<T>& pixels, int channels);

  GlContextMaker make_context_;
  std::unique_ptr<GlContext> context_;
  Gl gl_;
  GLuint program_ = 0, framebuffer_ = 0, depth_buffer_ = 0, vertex_array_ = 0;
  std::array<GLuint, target_count> targets_{};
  std::array<GLuint, storage_count> storage_{};
  int width_ = 0, height_ = 0;
  Channel channels_ = Channel::colour;
  bool targets_ready_ = false;
  std::map<std::shared_ptr<const Image>, GLuint> textures_;
  std::vector<float> floats_;
  std::vector<std::int32_t> ints_;
};

std::unique_ptr<GlContext> current_context(GlContextMaker make) {
  std::unique_ptr<GlContext> context = make();
  context->make_current();
  return context;
}

OsmesaRenderer::OsmesaRenderer(GlContextMaker make_context)
    : make_context_(make_context), context_(current_context(make_context)), gl_(*context_) {
  build_program();
  gl_.GenVertexArrays(1, &vertex_array_);
  gl_.GenFramebuffers(1, &framebuffer_);
  gl_.GenBuffers(storage_count, storage_.data());
  gl_.BindVertexArray(vertex_array_);
  gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_);
  gl_.ClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  gl_.Enable(GL_DEPTH_TEST);
  gl_.DepthFunc(GL_GREATER);
  gl_.Disable(GL_CULL_FACE);
  gl_.Disable(GL_DITHER);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  check("setting up");
}

void OsmesaRenderer::check(const char* what) {
  const GLenum error = gl_.GetError();
  if (error != GL_NO_ERROR)
    throw SolverError("OpenGL error " + std::to_string(error) + " while " + what);
}

void OsmesaRenderer::build_program() {
  program_ = gl_.CreateProgram();
  for (const auto& [kind, source] :
       {std::pair<GLenum, const char*>{GL_VERTEX_SHADER, vertex_source},
        {GL_FRAGMENT_SHADER, fragment_source}}) {
    const GLuint shader = gl_.CreateShader(kind);
    gl_.ShaderSource(shader, 1, &source, nullptr);
    gl_.CompileShader(shader);
    gl_.AttachShader(program_, shader);
    gl_.DeleteShader(shader);
  }
  gl_.LinkProgram(program_);
  GLint linked = 0;
  gl_.GetProgramiv(program_, GL_LINK_STATUS, &linked);
  if (linked == 0) {
    std::array<char, 1024> log{};
    gl_.GetProgramInfoLog(program_, static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw SolverError(std::string("OpenGL refuses the shaders: ") + log.data());
  }
  gl_.UseProgram(program_);
}

void OsmesaRenderer::set_up_targets(int width, int height, Channel channels) {
  if (targets_ready_ && width == width_ && height == height_ && channels == channels_) return;
  GLint largest = 0;
  gl_.GetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &largest);
  if (width > largest || height > largest)
    throw InvalidInput("a picture of " + std::to_string(width) + " x " + std::to_string(height) +
                       " pixels is too large for OpenGL here: expected at most " +
                       std::to_string(largest) + " each way");
  constexpr std::array<GLenum, target_count> formats{GL_RGBA32F, GL_R32I, GL_RGBA32F, GL_RGBA32F};
  const std::array<bool, target_count> wanted{true, has(channels, Channel::triangle),
                                              has(channels, Channel::barycentric),
                                              has(channels, Channel::normal)};
  gl_.DeleteRenderbuffers(target_count, targets_.data());
  gl_.DeleteRenderbuffers(1, &depth_buffer_);
  gl_.GenRenderbuffers(target_count, targets_.data());
  gl_.GenRenderbuffers(1, &depth_buffer_);
  std::array<GLenum, target_count> drawn{};
  for (int i = 0; i < target_count; ++i) {
    drawn[i] = wanted[i] ? GL_COLOR_ATTACHMENT0 + i : GL_NONE;
    gl_.BindRenderbuffer(GL_RENDERBUFFER, targets_[i]);
    if (wanted[i]) gl_.RenderbufferStorage(GL_RENDERBUFFER, formats[i], width, height);
    gl_.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0 + i, GL_RENDERBUFFER,
                                wanted[i] ? targets_[i] : 0);
  }
  gl_.BindRenderbuffer(GL_RENDERBUFFER, depth_buffer_);
  gl_.RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, width, height);
  gl_.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_buffer_);
  gl_.DrawBuffers(target_count, drawn.data());
  check("making the framebuffer");
  if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw SolverError("OpenGL refuses the framebuffer");
  width_ = width, height_ = height, channels_ = channels, targets_ready_ = true;
}

void OsmesaRenderer::clear(const Scene& scene) {
  const std::array<float, 4> background{scene.background.x(), scene.background.y(),
                                        scene.background.z(), 0.0f};
  const std::array<float, 4> zero{};
  const std::array<GLint, 4> none{-1, -1, -1, -1};
  gl_.Viewport(0, 0, width_, height_);
  gl_.ClearBufferfv(GL_COLOR, colour_target, background.data());
  if (has(channels_, Channel::triangle)) gl_.ClearBufferiv(GL_COLOR, triangle_target, none.data());
  if (has(channels_, Channel::barycentric))
    gl_.ClearBufferfv(GL_COLOR, barycentric_target, zero.data());
  if (has(channels_, Channel::normal)) gl_.ClearBufferfv(GL_COLOR, normal_target, zero.data());
  gl_.ClearBufferfv(GL_DEPTH, 0, zero.data());
}

void OsmesaRenderer::upload(const Scene& scene, Channel channels) {
  const bool shaded = has(channels, Channel::colour) || has(channels, Channel::normal);
  std::vector<float> positions, normals, uvs;
  ints_.clear();
  for (const SceneObject& object : scene.objects) {
    const auto first = static_cast<std::int32_t>(positions.size() / 3);
    const auto& corners = object.mesh->triangles;
    std::transform(corners.data(), corners.data() + corners.size(), std::back_inserter(ints_),
                   [&](int corner) { return corner + first; });
    const PointsF& points = object.positions_m;
    positions.insert(positions.end(), points.data(), points.data() + points.size());
    if (shaded)
      normals.insert(normals.end(), object.normals.data(),
                     object.normals.data() + object.normals.size());
    uvs.insert(uvs.end(), object.mesh->uvs.data(),
               object.mesh->uvs.data() + object.mesh->uvs.size());
    uvs.resize(positions.size() / 3 * 2);  // objects without any
  }
  const auto fill = [&](Storage place_of, const void* data, std::size_t bytes) {
    gl_.BindBufferBase(GL_SHADER_STORAGE_BUFFER, place_of, storage_[place_of]);
    gl_.BufferData(GL_SHADER_STORAGE_BUFFER,
                   static_cast<GLsizeiptr>(std::max<std::size_t>(bytes, 4)),
                   bytes == 0 ? nullptr : data, GL_STREAM_DRAW);
  };
  fill(corner_storage, ints_.data(), 4 * ints_.size());
  fill(position_storage, positions.data(), 4 * positions.size());
  fill(normal_storage, normals.data(), 4 * normals.size());
  fill(uv_storage, uvs.data(), 4 * uvs.size());
  gl_.Uniform1i(place("shaded"), shaded);
}

void OsmesaRenderer::set_camera(const Camera& camera) {
  const Eigen::Matrix3f rotation =
      camera.camera_from_world.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f translation = camera.camera_from_world.translation_m.cast<float>();
  gl_.UniformMatrix3fv(place("rotation"), 1, GL_FALSE, rotation.data());
  gl_.Uniform3fv(place("translation"), 1, translation.data());
  const auto set_pair = [&](const char* uniform, const Eigen::Vector2d& pair) {
    gl_.Uniform2f(place(uniform), static_cast<float>(pair.x()), static_cast<float>(pair.y()));
  };
  set_pair("focal", camera.focal_px);
  set_pair("principal", camera.principal_px);
  set_pair("size", {camera.width, camera.height});
}

GLuint OsmesaRenderer::texture(const std::shared_ptr<const Image>& image) {
  const auto [entry, is_new] = textures_.try_emplace(image, 0);
  if (is_new) {
    gl_.GenTextures(1, &entry->second);
    gl_.BindTexture(GL_TEXTURE_2D, entry->second);
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGB32F, image->width, image->height, 0, GL_RGB, GL_FLOAT,
                   image->data.data());
    check("loading a texture");
  }
  return entry->second;
}

void OsmesaRenderer::drop_unused_textures(const Scene& scene) {
  std::erase_if(textures_, [&](const auto& entry) {
    const bool used = std::any_of(
        scene.objects.begin(), scene.objects.end(),
        [&](const SceneObject& object) { return object.material.texture == entry.first; });
    if (!used) gl_.DeleteTextures(1, &entry.second);
    return !used;
  });
}

void OsmesaRenderer::draw(const Scene& scene, Channel channels) {
  gl_.Uniform3fv(place("light"), 9, scene.light.coefficients[0].data());
  GLint first = 0;
  for (const SceneObject& object : scene.objects) {
    const bool textured = has(channels, Channel::colour) && object.material.texture != nullptr;
    if (textured) gl_.BindTexture(GL_TEXTURE_2D, texture(object.material.texture));
    gl_.Uniform1i(place("textured"), textured);
    gl_.Uniform3fv(place("colour"), 1, object.material.colour.data());
    const auto count = static_cast<GLsizei>(3 * object.mesh->triangle_count());
    gl_.DrawArrays(GL_TRIANGLES, first, count);
    first += count;
  }
  drop_unused_textures(scene);
  check("drawing");
}

template <class T>
const T* OsmesaRenderer::read_target(Target target, const Camera& camera, GLenum format,
                                     GLenum type, std::vector<T>& pixels, int channels) {
  pixels.resize(static_cast<std::size_t>(camera.width) * camera.height * channels);
  gl_.ReadBuffer(GL_COLOR_ATTACHMENT0 + target);
  gl_.ReadPixels(0, 0, camera.width, camera.height, format, type, pixels.data());
  return pixels.data();
}

void copy_three_of_four(const float* rgba, Image& image) {
  for (std::size_t i = 0; i < image.data.size() / 3; ++i)
    std::copy_n(rgba + 4 * i, 3, image.data.data() + 3 * i);
}

void OsmesaRenderer::read_back(const Camera& camera, Frame& frame) {
  // Four channels: packing three is slow in Mesa.
  if (!frame.colour.empty() || !frame.depth.empty() || !frame.mask.empty()) {
    const float* rgbd = read_target(colour_target, camera, GL_RGBA, GL_FLOAT, floats_, 4);
    if (!frame.colour.empty()) copy_three_of_four(rgbd, frame.colour);
    for (std::size_t i = 0; i < frame.depth.data.size(); ++i) frame.depth.data[i] = rgbd[4 * i + 3];
    for (std::size_t i = 0; i < frame.mask.size(); ++i) frame.mask[i] = rgbd[4 * i + 3] > 0.0f;
  }
  if (!frame.triangle.empty())
    read_target(triangle_target, camera, GL_RED_INTEGER, GL_INT, frame.triangle, 1);
  if (!frame.barycentric.empty())
    copy_three_of_four(read_target(barycentric_target, camera, GL_RGBA, GL_FLOAT, floats_, 4),
                       frame.barycentric);
  if (!frame.normal.empty())
    copy_three_of_four(read_target(normal_target, camera, GL_RGBA, GL_FLOAT, floats_, 4),
                       frame.normal);
  check("reading back");
}

Frame OsmesaRenderer::render(const Scene& scene, const Camera& camera, Channel channels) {
  check_renderable(scene, camera);
  check_shadable(scene, channels);
  context_->make_current();
  set_up_targets(camera.width, camera.height, channels);
  clear(scene);
  upload(scene, channels);
  set_camera(camera);
  draw(scene, channels);
  Frame frame = empty_frame(scene, camera, channels);
  read_back(camera, frame);
  return frame;
}

}  // namespace

std::unique_ptr<Renderer> make_gl_renderer(GlContextMaker make_context) {
  return std::make_unique<OsmesaRenderer>(make_context);
}
std::unique_ptr<Renderer> make_osmesa_renderer() { return make_gl_renderer(make_gl_context); }

}  // namespace semblance
