// The parts of ContactFinder. Gathering near pairs is in gather.cc, gaps in contact.cc, steps in
// step.cc, and what steps need beyond the gathered pairs in sweep.cc.
#pragma once

#include <array>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bounds_tree.h"
#include "near_pairs.h"
#include "pair_geometry.h"
#include "placed_obstacle.h"
#include "semblance/cloth/contact.h"
#include "surface_topology.h"

namespace semblance {

inline constexpr int chunk_size = 1024;  // pairs that one call of a parallel loop looks at

/// The near pairs of one kind, sorted.
struct PairGroup {
  ContactKind kind;
  int obstacle;
  std::vector<NearPair> pairs;
};

struct Chunk {
  const PairGroup* group;
  std::size_t begin, end;
};

/// Groups that are gathered together, from positions that are their reference.
struct PairFamily {
  explicit PairFamily(bool with_obstacles) : against_obstacles(with_obstacles) {}

  bool against_obstacles;
  bool gathered = false;
  std::vector<PairGroup> groups;
  Points reference_m;
  std::vector<float> strayed_m;  // of each vertex from the reference, at the last update
  float most_strayed_m = 0.0f;
  double margin_m = 0.0;
  int updates = 0;  // since they were gathered
};

/// Vertices of the cloth in the two pieces of a pair.
struct PairVertices {
  int first_count = 0, second_count = 0;
  std::array<int, 3> first{}, second{};
};

struct Positions {
  PairPoints points;
  PairVertices vertices;
};

inline bool is_self(ContactKind kind) {
  return kind == ContactKind::vertex_triangle || kind == ContactKind::edge_edge;
}

/// In float, and not less.
inline float upwards(double value) { return static_cast<float>(value * (1.0 + 1e-6)); }

class ContactFinder::Impl {
 public:
  Impl(const ContactSurface& surface, std::vector<Obstacle> obstacles,
       const ContactOptions& options);

  void place_obstacles(double time_s) {
    found_at_.resize(0, 3);
    for (PlacedObstacle& obstacle : placed_) obstacle.place(time_s);
  }
  void update(const Points& x);
  const std::vector<Contact>& contacts(const Points& x);
  double max_step(const Points& x, const Points& dx);
  void max_vertex_steps(const Points& x, const Points& dx, Eigen::VectorXd& fractions);
  double max_step_until(const Points& x, const Points& dx, double time_s);
  void move_obstacles(double time_s, double fraction);
  std::vector<Penetration> penetrations(const Points& x, bool brute_force) const;
  std::set<std::pair<int, int>> stuck_in_solids(const Points& x);
  double push_out(Points& x, double stride_m);
  std::optional<std::string> start_problem(const Points& x);
  Statistics statistics() const;

  const SurfaceTopology& topology() const { return topology_; }
  const std::vector<Obstacle>& obstacles() const { return obstacles_; }
  const PlacedObstacle& placed(int obstacle) const { return placed_[obstacle]; }

 private:
  void check(const Points& x) const;
  void check_options() const;
  void make_groups();
  void find_rest_neighbours(const Points& rest);

  double offset_m(const PairGroup& group) const {
    return group.obstacle < 0 ? options_.thickness_m
                              : 0.5 * options_.thickness_m + placed_[group.obstacle].rounding_m();
  }
  float obstacle_strayed(int o, bool at_end) const;

  void measure(PairFamily& family, const Points& x);
  bool is_stale(const PairFamily& family) const;
  void gather(PairFamily& family, const Points& x);
  void adapt_margin(PairFamily& family);
  void fit_bounds(const Points& x, double inflation_m);
  void gather_self(const Points& x, double margin_m);
  void gather_against(int obstacle, const Points& x, double margin_m);
  void gather_vertices(PairGroup& group, const Points& x, double margin_m);
  void gather_features(int obstacle, const Points& x, double margin_m);
  void gather_mesh(int obstacle, const Points& x, double margin_m);
  PairGroup& group_of(std::vector<PairGroup>& groups, ContactKind kind, int obstacle);
  void collect(PairGroup& group, std::size_t task_count, int slot);
  int count_of_first(ContactKind kind) const;

  void sweep(const Points& x, const Points& dx);
  void sweep_self();
  void sweep_solid(int obstacle, const Points& x, const Points& dx);
  void sweep_mesh(int obstacle);
  void measure_path(const PairFamily& family, const Points& x, const Points& dx,
                    std::vector<float>& path) const;
  bool exceeds(const PairFamily& family, const std::vector<float>& path) const;

  void list_chunks(const std::vector<PairGroup>& groups);
  PairVertices vertices_of(const PairGroup& group, const NearPair& pair) const;
  void load(const PairGroup& group, const NearPair& pair, const Points& x, double fraction,
            const Points* dx, Positions& result) const;
  bool is_far(const PairGroup& group, const NearPair& pair, const std::vector<float>& strayed,
              bool at_end, double gap_m) const;
  void add_contact(const PairGroup& group, const NearPair& pair, const Points& x,
                   std::vector<Contact>& out) const;
  void add_solid_contact(const PairGroup& group, const NearPair& pair, const Points& x,
                         std::vector<Contact>& out) const;
  double pair_area(const PairGroup& group, const NearPair& pair, const PairPoints& points,
                   double reach_m) const;
  PairMotion motion_of(const PairGroup& group, const NearPair& pair, const PairVertices& vertices,
                       const Points& dx) const;
  double pair_step(const PairGroup& group, const NearPair& pair, const Points& x, const Points& dx,
                   double limit) const;
  double solid_step(const PairGroup& group, const NearPair& pair, const Points& x, const Points& dx,
                    double limit) const;
  double step(const Points& x, const Points& dx);
  void limit_vertices(const PairGroup& group, const NearPair& pair, const Points& x,
                      const Points& dx, std::vector<std::pair<int, double>>& limits) const;

  ContactOptions options_;
  std::vector<Obstacle> obstacles_;
  std::vector<PlacedObstacle> placed_;
  BoundsTree tree_;
  SurfaceTopology topology_;
  RestNeighbours rest_neighbours_;
  double cloth_radius_m_ = 0.0;  // about each plane's origin, for planes that turn
  double mean_edge_m_ = 0.0;
  PairFamily self_{false}, against_{true};
  std::vector<PairGroup> swept_;

  // Kept between calls for their memory.
  SurfaceBounds<Box> bounds_;
  std::vector<SurfaceBounds<Box>> mesh_bounds_;
  SurfaceBounds<SweptBox> swept_bounds_;
  SurfaceBounds<SweptBox> swept_mesh_bounds_;
  std::vector<std::array<std::vector<NearPair>, 3>> found_;  // by task
  std::vector<NearPair> scratch_;
  std::vector<int> starts_;
  std::vector<float> self_path_, against_path_;
  std::vector<float> obstacle_strayed_, obstacle_path_;
  std::vector<Chunk> chunks_;
  std::vector<std::vector<Contact>> chunk_contacts_;
  std::vector<std::vector<std::pair<int, double>>> chunk_limits_;
  std::vector<Contact> contacts_;
  Points found_at_;  // positions of the cloth that contacts_ are of; empty: none
  Statistics statistics_;
};

}  // namespace semblance
