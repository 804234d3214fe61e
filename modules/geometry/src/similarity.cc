#include "semblance/geometry/similarity.h"

#include <complex>

#include "semblance/core/errors.h"

namespace semblance {

Eigen::Affine2d fit_similarity(const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to,
                               bool scale) {
  if (from.cols() != to.cols() || from.cols() < 2 || !from.allFinite() || !to.allFinite()) {
    throw InvalidInput("similarity: two finite sets of as many points, at least two, are needed");
  }
  using Complex = std::complex<double>;
  const Eigen::Vector2d from_mean = from.rowwise().mean(), to_mean = to.rowwise().mean();
  Complex product = 0.0;
  double spread = 0.0;
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    const Eigen::Vector2d a = from.col(i) - from_mean, b = to.col(i) - to_mean;
    product += std::conj(Complex(a.x(), a.y())) * Complex(b.x(), b.y());
    spread += a.squaredNorm();
  }
  if (!(spread > 0.0)) throw InvalidInput("similarity: all points are at one place");
  const double length = std::abs(product);
  // Without any correlation no rotation is better than another.
  const Complex turn = length > 0.0 ? product / length : Complex(1.0);
  const Complex factor = scale ? product / spread : turn;
  Eigen::Affine2d to_from = Eigen::Affine2d::Identity();
  to_from.linear() << factor.real(), -factor.imag(), factor.imag(), factor.real();
  to_from.translation() = to_mean - to_from.linear() * from_mean;
  return to_from;
}

}  // namespace semblance
