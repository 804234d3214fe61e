#include "face_expression.h"

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>

#include "face_profile.h"
#include "face_skin.h"
#include "semblance/geometry/homotopy.h"

namespace semblance::face {
namespace {

using Eigen::Vector3d;

constexpr double degree = std::numbers::pi / 180.0;
constexpr double no_sigma = std::numeric_limits<double>::infinity();
const Vector3d condyle_mm(0.0, -14.0, -72.0);  // middle of the axis through both condyles
const Vector3d mouth_mm(0.0, -67.0, 26.0);
constexpr double jaw_open_rad = 19.0 * degree, gaze_yaw_rad = 35.0 * degree,
                 gaze_pitch_rad = 25.0 * degree;

/// A vertex as the expressions see it: mirrored to the left half.
struct Vertex {
  const Place& place;
  Vector3d p;      // x >= 0
  double x;        // signed
  double contact;  // height of the lips' line of contact at its column
  double mouth;    // 0 in the middle, 1 at the mouth's corner, larger beyond
  bool lower;      // below the slit of the mouth
};
using Motion = std::function<Vector3d(const Vertex&)>;

bool is_face(const Place& place) {
  return place.patch != Patch::eyeball && place.patch != Patch::ear &&
         place.patch != Patch::upper_teeth && place.patch != Patch::lower_teeth;
}
bool is_lip_lining(const Place& place) {
  return place.patch == Patch::upper_lip_inside || place.patch == Patch::lower_lip_inside;
}
bool is_lid_lining(const Place& place) {
  return place.patch == Patch::upper_lid_inside || place.patch == Patch::lower_lid_inside;
}

// How much of the jaw's motion a place takes: 1 on chin and lower teeth, 0 above the mouth, half at
// its corners and beyond, so that the slit opens.
double jaw_share(const Vertex& v) {
  const Place& place = v.place;
  switch (place.patch) {
    case Patch::lower_teeth:
      return 1.0;
    case Patch::upper_teeth:
    case Patch::eyeball:
    case Patch::ear:
    case Patch::upper_lid_inside:
    case Patch::lower_lid_inside:
      return 0.0;
    default:
      break;
  }
  if (is_lip_lining(place) && place.depth == 4) return 0.5;
  const double below = v.contact - v.p.y();
  const double smooth = smooth_step(below, -17.0, 17.0);
  double share = smooth;
  if (v.mouth < 1.0) {
    const double g = 0.5 * std::sqrt(1.0 - v.mouth * v.mouth);
    const double t = std::abs(2.0 * (is_lip_lining(place) ? 0.5 : smooth) - 1.0);
    const double lower = 0.5 + g + (0.5 - g) * t;
    share = v.lower ? lower : 1.0 - lower;
  }
  if (is_lip_lining(place)) return share;
  const double side = 1.0 - smooth_step(place.column, column_zygion - 0.4, column_ear);
  const double neck = 1.0 - smooth_step(place.row, line_jaw + 0.2, line_neck + 0.9);
  return share * side * neck;
}

// How much of the lips' motion the lining behind them takes. At the mouth's corners the sheets meet
// and move as one; away from them the palate, the floor and the throat stay.
double lining_share(const Vertex& v) {
  static constexpr double inside[] = {1.0, 1.0, 0.7, 0.0, 0.0};
  const double open = std::sqrt(std::max(0.0, 1.0 - v.mouth * v.mouth));
  return 1.0 - (1.0 - inside[v.place.depth]) * open;
}

double left_share(double x) { return smooth_step(x, -9.0, 9.0); }

// Lips and their surroundings, falling off around the mouth.
double around_mouth(const Vertex& v, double reach) {
  if (!is_face(v.place) || is_lid_lining(v.place)) return 0.0;
  if (v.p.z() < -40.0 && !is_lip_lining(v.place)) return 0.0;
  const double dx = std::max(0.0, v.p.x() - 20.0);
  if (is_lip_lining(v.place)) return lining_share(v) * std::exp(-dx * dx / (reach * reach));
  const double dy = v.p.y() - v.contact;
  return std::exp(-(dx * dx + dy * dy) / (reach * reach)) * smooth_step(-v.p.y(), 36, 52);
}

// How far a place follows the lids: 1 at the margin, fading towards crease or cheek.
double upper_lid_share(const Vertex& v) {
  if (v.place.patch == Patch::upper_lid_inside) return 1.0;
  if (v.place.patch != Patch::skin || v.place.row > line_upper_lid) return 0.0;
  return smooth_step(v.place.row, line_lid_crease - 0.1, line_upper_lid - 0.1);
}
double lower_lid_share(const Vertex& v) {
  if (v.place.patch == Patch::lower_lid_inside) return 1.0;
  if (v.place.patch != Patch::skin || v.place.row < line_lower_lid) return 0.0;
  return 1.0 - smooth_step(v.place.row, line_lower_lid + 0.1, line_cheek_top);
}

class Maker {
 public:
  Maker(const std::vector<Place>& places, const Points& neutral, const Identity& identity)
      : identity_(identity) {
    for (std::size_t i = 0; i < places.size(); ++i) {
      vertices_.push_back(vertex(places[i], neutral.row(static_cast<Eigen::Index>(i))));
    }
  }

  Expressions make() {
    jaw();
    mouth();
    cheeks_and_nose();
    brows();
    eyes();
    return std::move(out_);
  }

 private:
  // Position of a place on the left half of the mean face.
  Vector3d on_skin_at(double column, int line) const {
    Place place;
    place.column = column;
    place.row = line;
    return sweep({place}, identity_).row(0);
  }

  Vertex vertex(const Place& place, const Vector3d& p) const {
    Vertex v{place, {std::abs(p.x()), p.y(), p.z()}, p.x(), 0.0, 0.0, false};
    const bool on_skin = place.patch == Patch::skin || is_lip_lining(place);
    if (on_skin) {
      v.contact = on_skin_at(place.column, line_upper_contact).y();
      v.mouth = skin_.angle(place.column) / skin_.angle(column_mouth_corner);
    }
    v.lower = place.patch == Patch::lower_lip_inside ||
              (place.patch == Patch::skin && place.row >= line_lower_contact);
    return v;
  }

  void parameter(const std::string& name, double lower, const std::string& doc) {
    out_.parameters.push_back(scalar_block(name, "1", lower, 1.0, 0.0, 0.3, doc));
  }

  // Adds a field for the newest parameter; `motion` gives the left half's displacement in mm and is
  // mirrored, unless `signed_x` says that it knows the side itself.
  void field(std::function<Weight(double)> weight, const Motion& motion, bool signed_x = false) {
    MorphField field;
    field.parameter = static_cast<int>(out_.parameters.size()) - 1;
    field.weight = std::move(weight);
    std::vector<Vector3d> moved;
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const Vertex& v = vertices_[i];
      Vector3d d = motion(v);
      if (!signed_x) d.x() *= v.place.side;
      if (d.norm() < 2e-4) continue;
      field.vertices.push_back(static_cast<int>(i));
      moved.push_back(d);
    }
    field.displacement_m.resize(static_cast<Eigen::Index>(moved.size()), 3);
    for (std::size_t i = 0; i < moved.size(); ++i) {
      field.displacement_m.row(static_cast<Eigen::Index>(i)) = (1e-3 * moved[i]).cast<float>();
    }
    if (!moved.empty()) out_.fields.push_back(std::move(field));
  }

  // A homotopy path common to all vertices: displacement `change` at 1, velocities at 0 and 1.
  void path(double n, const Motion& change, const Motion& start, const Motion& end) {
    field(
        [n](double t) {
          const auto w = homotopy_weights(t, n).change;
          return Weight{w.value, w.slope};
        },
        change);
    field(
        [n](double t) {
          const auto w = homotopy_weights(t, n).start;
          return Weight{w.value, w.slope};
        },
        start);
    field(
        [n](double t) {
          const auto w = homotopy_weights(t, n).end;
          return Weight{w.value, w.slope};
        },
        end);
  }
  // A path whose velocities are the change with the radial and tangential parts (about the middle
  // of the mouth, in the frontal plane) weighted differently: it bends.
  void bent_path(const Motion& change, double radial0, double tangential0, double radial1,
                 double tangential1) {
    const auto turned = [change](double radial, double tangential) {
      return [=](const Vertex& v) -> Vector3d {
        const Vector3d d = change(v);
        Vector3d r(v.p.x() - mouth_mm.x(), v.p.y() - mouth_mm.y(), 0.0);
        if (r.norm() < 1e-9) return d;
        r.normalize();
        const Vector3d along = r.dot(d) * r;
        const Vector3d rest = d - along;
        return radial * along + Vector3d(tangential * rest.x(), tangential * rest.y(), rest.z());
      };
    };
    path(0.0, change, turned(radial0, tangential0), turned(radial1, tangential1));
  }
  static Motion one_side(const Motion& motion, bool left) {
    return [motion, left](const Vertex& v) -> Vector3d {
      const double share = left_share(left ? v.x : -v.x);
      if (share == 0.0) return Vector3d::Zero();
      return share * motion(v);
    };
  }

  void jaw() {
    parameter("jaw_open", 0.0, "jaw turned about the condyles' axis, 1 is 19 degrees");
    const auto arm = [](const Vertex& v) {
      return Vector3d(0, v.p.y() - condyle_mm.y(), v.p.z() - condyle_mm.z());
    };
    field(
        [](double t) {
          return Weight{std::sin(jaw_open_rad * t), jaw_open_rad * std::cos(jaw_open_rad * t)};
        },
        [arm](const Vertex& v) -> Vector3d {
          const Vector3d a = arm(v);
          return jaw_share(v) * Vector3d(0, -a.z(), a.y());
        });
    field(
        [](double t) {
          return Weight{1 - std::cos(jaw_open_rad * t), jaw_open_rad * std::sin(jaw_open_rad * t)};
        },
        [arm](const Vertex& v) -> Vector3d { return -jaw_share(v) * arm(v); });
    parameter("jaw_forward", 0.0, "jaw forwards, 1 is 6 mm");
    field({}, [](const Vertex& v) -> Vector3d { return jaw_share(v) * Vector3d(0, 0, 6); });
    parameter("jaw_side", -1.0, "jaw to the subject's left, 1 is 8 mm");
    field(
        {}, [](const Vertex& v) -> Vector3d { return jaw_share(v) * Vector3d(8, 0, 0); }, true);
  }

  static double corner(const Vertex& v, double reach) {
    if (!is_face(v.place) || is_lid_lining(v.place)) return 0.0;
    const bool lining = is_lip_lining(v.place);
    if (!lining && v.p.z() < -45.0) return 0.0;
    const double y = lining ? 0.0 : v.p.y() - v.contact;
    // Quadratic in the middle, so that the lips bend there without a kink.
    const double t = v.p.x() / 26.0;
    const double x = t < 1.0 ? t * t * (2.0 - t) : bump(v.p.x(), 26.0, reach);
    return x * bump(y, 0.0, reach) * (lining ? lining_share(v) : 1.0);
  }
  // Share of the upper or lower lip at the mouth's middle; the slit parts them.
  static double lip(const Vertex& v, bool lower, double reach) {
    const double a = around_mouth(v, reach);
    if (v.mouth >= 1.0) return 0.0;
    if (v.lower != lower) return 0.0;
    return a * (1.0 - v.mouth * v.mouth);
  }
  static double vermilion(const Vertex& v, bool lower) {
    if (v.lower != lower || v.mouth >= 1.0) return 0.0;
    if (is_lip_lining(v.place)) return v.place.depth == 1 ? 1.0 - v.mouth * v.mouth : 0.0;
    if (v.place.patch != Patch::skin) return 0.0;
    const double dy = std::abs(v.p.y() - v.contact);
    return (1.0 - smooth_step(dy, 3.0, 13.0)) * (1.0 - v.mouth * v.mouth);
  }

  void mouth() {
    const auto both = [&](const std::string& name, const std::string& doc, const Motion& motion,
                          double r0, double t0, double r1, double t1) {
      for (const bool left : {true, false}) {
        parameter(name + (left ? "_left" : "_right"), 0.0, doc);
        bent_path(one_side(motion, left), r0, t0, r1, t1);
      }
    };
    both(
        "mouth_smile", "corner of the mouth outwards, then up and back",
        [](const Vertex& v) -> Vector3d {
          const double k = corner(v, 24.0);
          const double apple = bump2(v.p.x(), v.p.y(), 42, -36, 15, 14) *
                               (v.p.z() > -40 && v.place.patch == Patch::skin ? 1.0 : 0.0);
          return k * Vector3d(8.0, 7.5, -6.0) + apple * Vector3d(1.0, 2.5, 2.5);
        },
        1.5, 0.5, 0.5, 1.4);
    both(
        "mouth_frown", "corner of the mouth down",
        [](const Vertex& v) -> Vector3d { return corner(v, 20.0) * Vector3d(1.5, -8.0, -1.5); },
        1.3, 0.7, 0.7, 1.2);
    both(
        "mouth_stretch", "corner of the mouth outwards",
        [](const Vertex& v) -> Vector3d { return corner(v, 24.0) * Vector3d(9.0, -2.5, -6.0); },
        1.2, 0.6, 0.8, 1.2);
    both(
        "mouth_upper_up", "upper lip raised",
        [](const Vertex& v) -> Vector3d {
          return lip(v, false, 20.0) * bump(v.p.x(), 11.0, 14.0) * Vector3d(0.5, 7.0, 0.8);
        },
        0.9, 0.9, 0.9, 0.9);
    both(
        "mouth_lower_down", "lower lip lowered",
        [](const Vertex& v) -> Vector3d {
          return lip(v, true, 20.0) * bump(v.p.x(), 11.0, 14.0) * Vector3d(0.8, -7.0, 0.5);
        },
        0.9, 0.9, 0.9, 0.9);
    parameter("mouth_funnel", 0.0, "lips parted and pushed forwards in a ring");
    bent_path(
        [](const Vertex& v) -> Vector3d {
          const double a = around_mouth(v, 20.0);
          const double open = v.lower ? -lip(v, true, 22.0) : lip(v, false, 22.0);
          return a * Vector3d(-7.0 * ramp(v.p.x(), 0, 26), 0.0, 6.0) + open * Vector3d(0, 6.0, 0);
        },
        0.6, 1.3, 1.2, 0.8);
    parameter("mouth_pucker", 0.0, "lips drawn together and forwards");
    bent_path(
        [](const Vertex& v) -> Vector3d {
          const double a = around_mouth(v, 20.0);
          return a * Vector3d(-12.0 * ramp(v.p.x(), 0, 26), 0.0, 7.0);
        },
        0.7, 1.2, 1.1, 0.8);
    parameter("mouth_press", 0.0, "lips pressed together, the red thinner");
    bent_path(
        [](const Vertex& v) -> Vector3d {
          const double dy = v.p.y() - v.contact;
          const double k = vermilion(v, v.lower);
          return k * Vector3d(0, is_lip_lining(v.place) ? 0.0 : -0.28 * dy, -1.2);
        },
        1, 1, 1, 1);
    for (const bool lower : {false, true}) {
      parameter(lower ? "mouth_roll_lower" : "mouth_roll_upper", 0.0,
                "lip rolled inwards over the teeth");
      bent_path(
          [lower](const Vertex& v) -> Vector3d {
            const double dy = v.p.y() - v.contact;
            const double k = vermilion(v, lower);
            return k * Vector3d(0, is_lip_lining(v.place) ? 0.0 : -0.45 * dy, -3.0);
          },
          1, 1.3, 1, 0.7);
    }
    parameter("mouth_side", -1.0, "mouth shifted to the subject's left, 1 is 9 mm");
    field(
        {}, [](const Vertex& v) -> Vector3d { return around_mouth(v, 24.0) * Vector3d(9.0, 0, 0); },
        true);
  }

  void cheeks_and_nose() {
    const auto skin = [](const Vertex& v) {
      return v.place.patch == Patch::skin && v.p.z() > -60.0 ? 1.0 : 0.0;
    };
    parameter("cheek_puff", 0.0, "cheeks blown up");
    field({}, [skin](const Vertex& v) -> Vector3d {
      return skin(v) * bump2(v.p.x(), v.p.y(), 44, -58, 18, 18) * Vector3d(6.0, 0, 5.5);
    });
    for (const bool left : {true, false}) {
      const std::string side = left ? "_left" : "_right";
      parameter("cheek_squint" + side, 0.0, "cheek raised under the eye");
      field({}, one_side(
                    [skin](const Vertex& v) -> Vector3d {
                      return skin(v) * smooth_step(-v.p.y(), 7, 16) *
                             bump2(v.p.x(), v.p.y(), 38, -22, 16, 11) * Vector3d(0.5, 4.5, 2.0);
                    },
                    left));
      parameter("nose_sneer" + side, 0.0, "wing of the nose raised");
      field({}, one_side(
                    [skin](const Vertex& v) -> Vector3d {
                      return skin(v) * bump2(v.p.x(), v.p.y(), 17, -36, 8, 13) *
                             Vector3d(0.8, 5.0, 0.5);
                    },
                    left));
    }
  }

  void brows() {
    const auto skin = [](const Vertex& v) {
      return v.place.patch == Patch::skin && v.p.z() > -60.0 ? smooth_step(v.p.y(), 7, 16) : 0.0;
    };
    for (const bool left : {true, false}) {
      const std::string side = left ? "_left" : "_right";
      parameter("brow_down" + side, 0.0, "eyebrow lowered and drawn inwards");
      field({}, one_side(
                    [skin](const Vertex& v) -> Vector3d {
                      return skin(v) * bump2(v.p.x(), v.p.y(), 20, 21, 20, 12) *
                             Vector3d(-3.0, -6.0, 0.8);
                    },
                    left));
      parameter("brow_outer_up" + side, 0.0, "outer half of the eyebrow raised");
      field({}, one_side(
                    [skin](const Vertex& v) -> Vector3d {
                      return skin(v) * bump2(v.p.x(), v.p.y(), 40, 24, 16, 16) *
                             Vector3d(0, 8.0, -1.0);
                    },
                    left));
    }
    parameter("brow_inner_up", 0.0, "inner ends of the eyebrows raised");
    field({}, [skin](const Vertex& v) -> Vector3d {
      return skin(v) * bump2(v.p.x(), v.p.y(), 10, 24, 17, 15) * Vector3d(0, 8.0, -0.8);
    });
  }

  static Vector3d turned_about_x(const Vector3d& q, double a) {
    return {q.x(), q.y() * std::cos(a) - q.z() * std::sin(a),
            q.y() * std::sin(a) + q.z() * std::cos(a)};
  }

  // Turns about the eye's horizontal axis, and moves by `extra` at the end. A vertex that turns by
  // the angle w * full starts with the velocity of its own circle and ends on it; in between it
  // follows sin and 1 - cos of the common angle, which for w = 1 is the circle itself.
  void lids(const std::function<double(const Vertex&)>& angle, double full, bool left,
            const Motion& extra = {}) {
    const auto eye = Vector3d(eye_x_mm, 0, 0);
    const auto sine = [=](const Vertex& v) -> Vector3d {
      const Vector3d q = v.p - eye;
      return angle(v) / full * Vector3d(0, -q.z(), q.y());
    };
    const auto cosine = [=](const Vertex& v) -> Vector3d {
      const double a = angle(v);
      if (a == 0.0) return Vector3d::Zero();
      const Vector3d q = v.p - eye;
      Vector3d turned = turned_about_x(q, a) - q;
      if (extra) turned += extra(v);
      return (turned - std::sin(full) * sine(v)) / (1.0 - std::cos(full));
    };
    field(
        [full](double t) {
          return Weight{std::sin(full * t), full * std::cos(full * t)};
        },
        one_side(sine, left));
    field(
        [full](double t) {
          return Weight{1 - std::cos(full * t), full * std::sin(full * t)};
        },
        one_side(cosine, left));
  }

  // How a margin gets to the line where the lids meet, at the place's column: the angle, and what
  // is left to the point midway between the two turned margins.
  struct Closing {
    double angle = 0.0;
    Vector3d rest = Vector3d::Zero();
  };
  Closing closing(const Vertex& v, bool upper) const {
    const double s = skin_.eye_fraction(skin_.angle(v.place.column));
    if (s <= 0.0 || s >= 1.0) return {};
    const Vector3d eye(eye_x_mm, 0, 0);
    const Vector3d a = on_skin_at(v.place.column, line_upper_lid) - eye;
    const Vector3d b = on_skin_at(v.place.column, line_lower_lid) - eye;
    const double top = std::atan2(a.y(), a.z()), low = std::atan2(b.y(), b.z());
    const double meet = low + 0.22 * (top - low);
    const Vector3d a1 = turned_about_x(a, top - meet), b1 = turned_about_x(b, low - meet);
    const Vector3d middle = 0.5 * (a1 + b1);
    return upper ? Closing{top - meet, middle - a1} : Closing{low - meet, middle - b1};
  }

  void eyes() {
    for (const bool left : {true, false}) {
      const std::string side = left ? "_left" : "_right";
      parameter("eye_blink" + side, 0.0, "lids closed, turning about the eyeball's centre");
      lids(
          [this](const Vertex& v) {
            const double up = upper_lid_share(v), low = lower_lid_share(v);
            if (up > 0.0) return up * closing(v, true).angle;
            return low > 0.0 ? low * closing(v, false).angle : 0.0;
          },
          45.0 * degree, left,
          [this](const Vertex& v) -> Vector3d {
            const double up = upper_lid_share(v), low = lower_lid_share(v);
            if (up > 0.0) return up * closing(v, true).rest;
            return low > 0.0 ? Vector3d(low * closing(v, false).rest) : Vector3d(Vector3d::Zero());
          });
      parameter("eye_squint" + side, 0.0, "lids narrowed, the lower one raised");
      lids(
          [this](const Vertex& v) {
            const double up = upper_lid_share(v), low = lower_lid_share(v);
            if (up > 0.0) return 0.15 * up * closing(v, true).angle;
            return low > 0.0 ? 0.9 * low * closing(v, false).angle : 0.0;
          },
          20.0 * degree, left);
      parameter("eye_wide" + side, 0.0, "upper lid raised");
      lids([this](const Vertex& v) { return -0.28 * upper_lid_share(v) * closing(v, true).angle; },
           15.0 * degree, left);
    }
    gaze("eye_look_horizontal", "both eyes to the subject's left, 1 is 35 degrees", gaze_yaw_rad,
         1);
    gaze("eye_look_vertical", "both eyes up, 1 is 25 degrees; the lids follow", -gaze_pitch_rad, 0);
    for (const bool left : {true, false}) {
      lids(
          [](const Vertex& v) {
            const double slit = slit_share(v.p.x() - eye_x_mm);
            return -gaze_pitch_rad * slit * (0.75 * upper_lid_share(v) + 0.35 * lower_lid_share(v));
          },
          -gaze_pitch_rad, left);
    }
  }

  void gaze(const std::string& name, const std::string& doc, double full, int axis) {
    parameter(name, -1.0, doc);
    const auto relative = [](const Vertex& v) {
      return Vector3d(v.x - (v.place.side > 0 ? eye_x_mm : -eye_x_mm), v.p.y(), v.p.z());
    };
    field(
        [full](double t) {
          return Weight{std::sin(full * t), full * std::cos(full * t)};
        },
        [=](const Vertex& v) -> Vector3d {
          if (v.place.patch != Patch::eyeball) return Vector3d::Zero();
          return Vector3d::Unit(axis).cross(relative(v));
        },
        true);
    field(
        [full](double t) {
          return Weight{1 - std::cos(full * t), full * std::sin(full * t)};
        },
        [=](const Vertex& v) -> Vector3d {
          if (v.place.patch != Patch::eyeball) return Vector3d::Zero();
          Vector3d q = relative(v);
          q[axis] = 0.0;
          return -q;
        },
        true);
  }

  const Identity& identity_;
  Skin skin_;
  std::vector<Vertex> vertices_;
  Expressions out_;
};

}  // namespace

Expressions make_expressions(const std::vector<Place>& places, const Points& neutral,
                             const Identity& identity) {
  return Maker(places, neutral, identity).make();
}

}  // namespace semblance::face
