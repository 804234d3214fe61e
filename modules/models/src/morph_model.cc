#include "semblance/models/morph_model.h"

#include <algorithm>
#include <cmath>

#include "semblance/core/errors.h"
#include "semblance/core/parallel.h"
#include "semblance/core/rigid3.h"

namespace semblance {
namespace {

// A vector of three coordinates in four lanes: every sum and product is one instruction.
using Float4 = float __attribute__((vector_size(16)));

template <class Vector>
Float4 float4(const Vector& v) {
  Float4 out = {};
  for (Eigen::Index i = 0; i < v.size(); ++i) out[i] = v[i];
  return out;
}

Weight field_weight(const MorphField& field, double parameter) {
  return field.weight ? field.weight(parameter) : Weight{parameter, 1.0};
}

void validate_field(const MorphField& field, std::size_t parameter_count, int vertex_count,
                    const std::string& where) {
  if (field.parameter < 0 || field.parameter >= static_cast<int>(parameter_count)) {
    throw InvalidInput(where + ": parameter " + std::to_string(field.parameter) +
                       " is not one of the shape's " + std::to_string(parameter_count));
  }
  if (static_cast<Eigen::Index>(field.vertices.size()) != field.displacement_m.rows()) {
    throw InvalidInput(where + ": " + std::to_string(field.vertices.size()) + " vertices but " +
                       std::to_string(field.displacement_m.rows()) + " displacements");
  }
  int previous = -1;
  for (int vertex : field.vertices) {
    if (vertex <= previous || vertex >= vertex_count) {
      throw InvalidInput(where + ": vertex " + std::to_string(vertex) +
                         " is out of range or not in ascending order");
    }
    previous = vertex;
  }
  if (!field.displacement_m.allFinite()) {
    throw InvalidInput(where + ": a displacement is not finite");
  }
}

void validate_landmark(const ModelLandmark& landmark, Eigen::Index triangle_count,
                       const std::string& source) {
  float sum = 0.0f;
  for (float weight : landmark.barycentric) sum += weight;
  if (landmark.triangle < 0 || landmark.triangle >= triangle_count ||
      !(std::abs(sum - 1.0f) < 1e-3f)) {
    throw InvalidInput(source + ": landmark '" + landmark.name +
                       "' must lie in a triangle of the mesh, with barycentric weights of sum 1");
  }
}

std::vector<ParameterBlock> pose_and_shape_blocks(const MorphShape& shape) {
  std::vector<ParameterBlock> blocks;
  blocks.push_back(rotation_block("rotation", "orientation of the model: world from model"));
  blocks.push_back(translation_block("translation", 10.0, "place of the model's origin"));
  blocks.insert(blocks.end(), shape.parameters.begin(), shape.parameters.end());
  return blocks;
}

}  // namespace

void validate(const MorphShape& shape, const std::string& source) {
  if (!shape.mesh) throw InvalidInput(source + ": the shape has no mesh");
  validate(*shape.mesh, source);
  const int vertex_count = static_cast<int>(shape.mesh->vertex_count());
  for (const ParameterBlock& block : shape.parameters) {
    if (block.size != 1 || block.manifold != Manifold::euclidean) {
      throw InvalidInput(source + ": parameter '" + block.name + "' must be a scalar");
    }
  }
  if (shape.identity_count < 0 ||
      shape.identity_count > static_cast<int>(shape.parameters.size())) {
    throw InvalidInput(source + ": identity_count exceeds the number of parameters");
  }
  for (std::size_t i = 0; i < shape.fields.size(); ++i) {
    validate_field(shape.fields[i], shape.parameters.size(), vertex_count,
                   source + ", field " + std::to_string(i));
  }
  for (const ModelLandmark& landmark : shape.landmarks) {
    validate_landmark(landmark, shape.mesh->triangle_count(), source);
  }
  if (!shape.part.empty() && static_cast<int>(shape.part.size()) != vertex_count) {
    throw InvalidInput(source + ": parts are given for " + std::to_string(shape.part.size()) +
                       " of " + std::to_string(vertex_count) + " vertices");
  }
}

MorphField make_field(int parameter, const PointsF& displacement_m, float threshold_m) {
  MorphField field;
  field.parameter = parameter;
  for (int vertex = 0; vertex < displacement_m.rows(); ++vertex) {
    const float length = displacement_m.row(vertex).norm();
    if (!(length <= threshold_m)) field.vertices.push_back(vertex);
  }
  field.displacement_m = displacement_m(field.vertices, Eigen::all);
  return field;
}

PointsF shape_positions(const MorphShape& shape, const Eigen::VectorXd& values) {
  PointsF positions = shape.mesh->positions_m.cast<float>();
  for (const MorphField& field : shape.fields) {
    const float weight = static_cast<float>(field_weight(field, values[field.parameter]).value);
    for (std::size_t i = 0; i < field.vertices.size(); ++i) {
      positions.row(field.vertices[i]) += weight * field.displacement_m.row(i);
    }
  }
  return positions;
}

MorphShape with_identity(const MorphShape& shape, const Eigen::VectorXd& identity) {
  if (identity.size() != shape.identity_count) {
    throw InvalidInput("identity: " + std::to_string(identity.size()) + " values given for " +
                       std::to_string(shape.identity_count) + " identity parameters");
  }
  const int removed = shape.identity_count;
  MorphShape result;
  result.parameters.assign(shape.parameters.begin() + removed, shape.parameters.end());
  result.landmarks = shape.landmarks;
  result.part = shape.part;
  auto mesh = std::make_shared<Mesh>(*shape.mesh);
  for (const MorphField& field : shape.fields) {
    if (field.parameter >= removed) {
      result.fields.push_back(field);
      result.fields.back().parameter -= removed;
      continue;
    }
    const double weight = field_weight(field, identity[field.parameter]).value;
    for (std::size_t i = 0; i < field.vertices.size(); ++i) {
      mesh->positions_m.row(field.vertices[i]) +=
          weight * field.displacement_m.row(i).cast<double>();
    }
  }
  result.mesh = std::move(mesh);
  return result;
}

/// Synthesis walks fields, whose vertices are packed into runs so that the inner loop is a
/// contiguous a*x + y. The Jacobian walks vertices, because a vertex's rows are contiguous there.
struct MorphModel::Tables {
  struct Run {
    int first_vertex = 0;
    int float_count = 0;
    std::size_t offset = 0;  // of its first float in `run_values`
  };
  PointsF neutral_m;
  std::vector<Run> runs;
  std::vector<std::size_t> first_run;  // per field, and one more
  std::vector<float> run_values;
  std::vector<Float4> entries;           // displacements in metre, grouped by vertex
  std::vector<int> entry_fields;         // of each entry
  std::vector<std::size_t> first_entry;  // per vertex, and one more

  explicit Tables(const MorphShape& shape);
  void add_runs(const MorphField& field);
  void add_entries(const MorphShape& shape);
};

MorphModel::Tables::Tables(const MorphShape& shape)
    : neutral_m(shape.mesh->positions_m.cast<float>()) {
  for (const MorphField& field : shape.fields) {
    first_run.push_back(runs.size());
    add_runs(field);
  }
  first_run.push_back(runs.size());
  add_entries(shape);
}

void MorphModel::Tables::add_runs(const MorphField& field) {
  // Adding a few zeros is cheaper than starting another run.
  constexpr int largest_gap = 4;
  for (std::size_t i = 0; i < field.vertices.size(); ++i) {
    const int vertex = field.vertices[i];
    const int gap = i == 0 ? largest_gap + 1 : vertex - field.vertices[i - 1] - 1;
    if (gap > largest_gap) {
      runs.push_back({vertex, 0, run_values.size()});
    } else {
      run_values.insert(run_values.end(), 3 * gap, 0.0f);
    }
    for (int axis = 0; axis < 3; ++axis) run_values.push_back(field.displacement_m(i, axis));
    runs.back().float_count = static_cast<int>(run_values.size() - runs.back().offset);
  }
}

void MorphModel::Tables::add_entries(const MorphShape& shape) {
  first_entry.assign(neutral_m.rows() + 1, 0);
  for (const MorphField& field : shape.fields) {
    for (int vertex : field.vertices) ++first_entry[vertex + 1];
  }
  for (std::size_t v = 1; v < first_entry.size(); ++v) first_entry[v] += first_entry[v - 1];
  entries.resize(first_entry.back());
  entry_fields.resize(first_entry.back());
  std::vector<std::size_t> next(first_entry.begin(), first_entry.end() - 1);
  for (std::size_t f = 0; f < shape.fields.size(); ++f) {
    const MorphField& field = shape.fields[f];
    for (std::size_t i = 0; i < field.vertices.size(); ++i) {
      const std::size_t at = next[field.vertices[i]]++;
      entries[at] = float4(field.displacement_m.row(i));
      entry_fields[at] = static_cast<int>(f);
    }
  }
}

MorphModel::MorphModel(MorphShape shape) : shape_(std::move(shape)) {
  validate(shape_, "morph model");
  space_ = ParameterSpace(pose_and_shape_blocks(shape_));
  tables_ = std::make_shared<const Tables>(shape_);
}

namespace {

struct Pose {
  Eigen::Matrix3f rotation;
  Eigen::Vector3f translation_m;
};

/// Parameter x[7 + i] is that of shape block i: pose first, all shape blocks scalar.
constexpr int first_shape_entry = 7;
constexpr int first_shape_tangent = 6;

Pose pose_of(const Eigen::VectorXd& x) {
  const Eigen::Quaterniond q(x[0], x[1], x[2], x[3]);
  return {q.normalized().toRotationMatrix().cast<float>(), x.segment<3>(4).cast<float>()};
}

void require_size(const Eigen::VectorXd& x, const ParameterSpace& space) {
  if (x.size() != space.size()) {
    throw InvalidInput("morph model: " + std::to_string(x.size()) + " parameter values given, " +
                       std::to_string(space.size()) + " expected");
  }
}

void place(const Pose& pose, PointsF& points) {
  const Eigen::Matrix3f& r = pose.rotation;
  const Eigen::Vector3f& t = pose.translation_m;
  float* p = points.data();
  for (Eigen::Index i = 0; i < points.rows(); ++i, p += 3) {
    const float x = p[0], y = p[1], z = p[2];
    for (int axis = 0; axis < 3; ++axis) {
      p[axis] = r(axis, 0) * x + r(axis, 1) * y + r(axis, 2) * z + t[axis];
    }
  }
}

}  // namespace

void MorphModel::synthesize(const Eigen::VectorXd& x, Scene& scene) const {
  require_size(x, space_);
  if (scene.objects.size() != 1 || scene.objects[0].mesh != shape_.mesh) {
    scene.objects.assign(1, SceneObject{});
    scene.objects[0].name = "face";
    scene.objects[0].mesh = shape_.mesh;
  }
  PointsF& positions = scene.objects[0].positions_m;
  positions = tables_->neutral_m;
  for (std::size_t f = 0; f < shape_.fields.size(); ++f) {
    const MorphField& field = shape_.fields[f];
    const float weight =
        static_cast<float>(field_weight(field, x[first_shape_entry + field.parameter]).value);
    if (weight == 0.0f) continue;
    for (std::size_t r = tables_->first_run[f]; r < tables_->first_run[f + 1]; ++r) {
      const Tables::Run& run = tables_->runs[r];
      const float* source = tables_->run_values.data() + run.offset;
      float* target = positions.data() + 3 * static_cast<std::size_t>(run.first_vertex);
      for (int i = 0; i < run.float_count; ++i) target[i] += weight * source[i];
    }
  }
  place(pose_of(x), positions);
  vertex_normals(positions, shape_.mesh->triangles, scene.objects[0].normals);
}

namespace {

/// What the Jacobian needs of one field at x.
struct FieldState {
  float weight = 0.0f, derivative = 0.0f;
  int column = -1;  // of `out`, -1 where the field's parameter is not asked for
};

void check_columns(const std::vector<int>& tangent_columns, Eigen::Index tangent_size) {
  for (int column : tangent_columns) {
    if (column >= 0 && column < tangent_size) continue;
    throw InvalidInput("morph model: there is no tangent column " + std::to_string(column));
  }
}

std::vector<FieldState> field_states(const MorphShape& shape, const Eigen::VectorXd& x,
                                     const std::vector<int>& tangent_columns) {
  std::vector<int> column_of(shape.parameters.size(), -1);
  for (std::size_t i = 0; i < tangent_columns.size(); ++i) {
    const int parameter = tangent_columns[i] - first_shape_tangent;
    if (parameter >= 0) column_of[parameter] = static_cast<int>(i);
  }
  std::vector<FieldState> states;
  for (const MorphField& field : shape.fields) {
    const Weight weight = field_weight(field, x[first_shape_entry + field.parameter]);
    states.push_back({static_cast<float>(weight.value), static_cast<float>(weight.derivative),
                      column_of[field.parameter]});
  }
  return states;
}

}  // namespace

struct MorphModel::Motion {
  /// A column of the output that belongs to the pose: number 0 to 5 of the tangent.
  struct PoseColumn {
    std::size_t place = 0;
    int number = 0;
  };

  const Tables& tables;
  std::vector<FieldState> states;
  std::vector<PoseColumn> pose_columns;
  Float4 rotation[3];  // columns

  Motion(const MorphModel& model, const Eigen::VectorXd& x, const std::vector<int>& columns)
      : tables(*model.tables_) {
    require_size(x, model.space_);
    check_columns(columns, model.space_.tangent_size());
    states = field_states(model.shape_, x, columns);
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (columns[i] < first_shape_tangent) pose_columns.push_back({i, columns[i]});
    }
    const Eigen::Matrix3f world_from_model = pose_of(x).rotation;
    for (int k = 0; k < 3; ++k) rotation[k] = float4(world_from_model.col(k));
  }

  /// Writes from_world * d(R p + t) of a vertex to rows `stride` floats apart.
  template <int Rows>
  void write(int vertex, const Eigen::Matrix<float, Rows, 3, Eigen::RowMajor>& from_world,
             std::size_t stride, float* rows) const {
    Float4 world[3], model[3];  // columns of from_world and of from_world * R
    for (int k = 0; k < 3; ++k) world[k] = float4(from_world.col(k));
    for (int k = 0; k < 3; ++k) model[k] = product(world, rotation[k]);
    std::fill(rows, rows + Rows * stride, 0.0f);
    Float4 position = float4(tables.neutral_m.row(vertex));
    for (std::size_t e = tables.first_entry[vertex]; e < tables.first_entry[vertex + 1]; ++e) {
      const Float4 displacement_m = tables.entries[e];
      const FieldState& state = states[tables.entry_fields[e]];
      position += state.weight * displacement_m;
      if (state.column < 0) continue;
      const Float4 motion = product(model, state.derivative * displacement_m);
      for (int r = 0; r < Rows; ++r) rows[r * stride + state.column] += motion[r];
    }
    // Rotation column k of d(R p + t) is e_k x (R p), translation column k is e_k.
    const Float4 rotated = product(rotation, position);
    for (const PoseColumn& column : pose_columns) {
      const int k = column.number % 3, next = (k + 1) % 3, last = (k + 2) % 3;
      const Float4 motion =
          column.number < 3 ? world[last] * rotated[next] - world[next] * rotated[last] : world[k];
      for (int r = 0; r < Rows; ++r) rows[r * stride + column.place] = motion[r];
    }
  }

  static Float4 product(const Float4* columns, Float4 v) {
    return columns[0] * v[0] + columns[1] * v[1] + columns[2] * v[2];
  }
};

bool MorphModel::vertex_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                                 const std::vector<int>* vertices, VertexJacobian& out) const {
  const Motion motion(*this, x, tangent_columns);
  const Eigen::Index vertex_count = tables_->neutral_m.rows();
  const std::size_t stride = tangent_columns.size();
  if (out.rows() != 3 * vertex_count || out.cols() != static_cast<Eigen::Index>(stride)) {
    out.resize(3 * vertex_count, static_cast<Eigen::Index>(stride));
  }
  const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> identity = Eigen::Matrix3f::Identity();
  const std::size_t count = vertices ? vertices->size() : static_cast<std::size_t>(vertex_count);
  for (std::size_t i = 0; i < count; ++i) {
    const int vertex = vertices ? (*vertices)[i] : static_cast<int>(i);
    motion.write(vertex, identity, stride,
                 out.data() + 3 * static_cast<std::size_t>(vertex) * stride);
  }
  return true;
}

bool MorphModel::image_jacobian(const Eigen::VectorXd& x, const std::vector<int>& tangent_columns,
                                const std::vector<int>& vertices,
                                const std::vector<ImageFromWorld>& image_from_world,
                                VertexJacobian& out) const {
  const Motion motion(*this, x, tangent_columns);
  const auto stride = static_cast<std::size_t>(out.cols());
  constexpr std::size_t kBlock = 512;  // vertices a task: about 50 us
  parallel_for((vertices.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    const std::size_t end = std::min(vertices.size(), (block + 1) * kBlock);
    for (std::size_t i = block * kBlock; i < end; ++i) {
      motion.write(vertices[i], image_from_world[i], stride, out.data() + 2 * i * stride);
    }
  });
  return true;
}

}  // namespace semblance
