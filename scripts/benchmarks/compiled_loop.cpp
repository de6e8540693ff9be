// The loop that an engineer would write in C++: equation (4) with Pinocchio's centroidal map and
// frame Jacobian, a dense solve, and the method DOP853 with SciPy's coefficients and step control.
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/serialization.hpp>

#include <algorithm>
#include <cmath>

#include "dop853.h"  // N_STAGES, A, B, C, E3, E5

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Loop {
  pinocchio::Model model;
  pinocchio::Data data;
  pinocchio::FrameIndex frame;
  Eigen::Vector3d momentum;
  MatrixXd twist;  // coefficients by power of the time, 6 x degree + 1
  MatrixXd J, M;
  VectorXd q, demand;
  double determinant = 0.0;

  Loop(const char* file, int frame_id, const double* h, const double* coefficients, int degree)
      : frame(frame_id), momentum(h), twist(Map<const MatrixXd>(coefficients, 6, degree + 1)) {
    pinocchio::serialization::loadFromText(model, file);
    data = pinocchio::Data(model);
    J = MatrixXd::Zero(6, model.nv);
    M = MatrixXd::Zero(12, model.nv);
    q = VectorXd::Zero(model.nq);
    demand = VectorXd::Zero(12);
  }

  void matrices(const VectorXd& joints_and_attitude) {
    q.segment(3, 4) = joints_and_attitude.head(4).normalized();
    q.tail(model.nq - 7) = joints_and_attitude.tail(model.nq - 7);
    pinocchio::computeCentroidalMap(model, data, q);
    J.setZero();
    pinocchio::computeFrameJacobian(model, data, q, frame, pinocchio::LOCAL_WORLD_ALIGNED, J);
  }

  void rates(double t, const VectorXd& y, VectorXd& result) {
    matrices(y);
    M.topRows(6) = data.Ag;
    M.bottomRows(6) = J;
    demand.segment(3, 3) = momentum;
    demand.tail(6) = twist.col(twist.cols() - 1);
    for (int k = int(twist.cols()) - 2; k >= 0; --k) demand.tail(6) = demand.tail(6) * t + twist.col(k);
    Eigen::PartialPivLU<MatrixXd> factors(M);
    determinant = factors.determinant();
    const VectorXd v = factors.solve(demand);
    const Eigen::Vector3d x = y.head(3), omega = v.segment(3, 3);
    result.head(3) = 0.5 * (y[3] * omega + x.cross(omega));
    result[3] = -0.5 * x.dot(omega);
    result.tail(model.nq - 7) = v.tail(model.nq - 7);
  }

  double integrate(VectorXd& y, double duration, double tolerance) {
    const int n = int(y.size());
    MatrixXd K(n, N_STAGES + 1);
    VectorXd f(n), y_new(n), f_new(n), scale(n);
    rates(0.0, y, f);
    double least = std::abs(determinant), t = 0.0;
    scale = tolerance + y.array().abs() * tolerance;
    const auto norm = [n](const VectorXd& x) { return x.norm() / std::sqrt(double(n)); };
    const double d0 = norm(y.cwiseQuotient(scale)), d1 = norm(f.cwiseQuotient(scale));
    const double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    y_new = y + h0 * f;
    rates(h0, y_new, f_new);
    const double d2 = norm((f_new - f).cwiseQuotient(scale)) / h0, largest = std::max(d1, d2);
    const double h1 = largest <= 1e-15 ? std::max(1e-6, h0 * 1e-3) : std::pow(0.01 / largest, 0.125);
    double h = std::min({100.0 * h0, h1, duration});
    bool rejected = false;
    while (t < duration) {
      h = std::min(h, duration - t);
      K.col(0) = f;
      for (int s = 1; s < N_STAGES; ++s) {
        y_new = y;
        for (int r = 0; r < s; ++r) y_new += h * A[s][r] * K.col(r);
        rates(t + C[s] * h, y_new, f_new);
        K.col(s) = f_new;
      }
      y_new = y;
      for (int s = 0; s < N_STAGES; ++s) y_new += h * B[s] * K.col(s);
      rates(t + h, y_new, f_new);
      K.col(N_STAGES) = f_new;
      scale = tolerance + y.array().abs().max(y_new.array().abs()) * tolerance;
      VectorXd e5 = VectorXd::Zero(n), e3 = VectorXd::Zero(n);
      for (int s = 0; s <= N_STAGES; ++s) e5 += E5[s] * K.col(s), e3 += E3[s] * K.col(s);
      const double n5 = e5.cwiseQuotient(scale).squaredNorm();
      const double n3 = e3.cwiseQuotient(scale).squaredNorm();
      const double error = n5 == 0.0 ? 0.0 : h * n5 / std::sqrt((n5 + 0.01 * n3) * n);
      const double factor = error == 0.0 ? 10.0 : 0.9 * std::pow(error, -0.125);
      if (error < 1.0) {
        t = t + h >= duration ? duration : t + h;
        y = y_new;
        f = f_new;
        least = std::min(least, std::abs(determinant));
        h *= std::min(rejected ? 1.0 : 10.0, factor);
      } else {
        h *= std::max(0.2, factor);
        if (h < 1e-12 * duration) return 0.0;  // a singularity
      }
      rejected = error >= 1.0;
    }
    return least;
  }
};

extern "C" {
Loop* prepare(const char* file, int frame, const double* h, const double* twist, int degree) {
  return new Loop(file, frame, h, twist, degree);
}

// Generalized Jacobian, 6 x n by columns, at joints (n,), as often as wanted.
void jacobian(Loop* loop, const double* joints, double* result, int times) {
  const int n = loop->model.nv - 6;
  VectorXd y = VectorXd::Zero(4 + n);
  y[3] = 1.0;
  y.tail(n) = Map<const VectorXd>(joints, n);
  for (int k = 0; k < times; ++k) {
    loop->matrices(y);
    Map<MatrixXd>(result, 6, n) =
        loop->J.rightCols(n) -
        loop->J.leftCols(6) * loop->data.Ag.leftCols(6).partialPivLu().solve(loop->data.Ag.rightCols(n));
  }
}

// Motions from starts (4 + n, count), which become their ends; minima (count,) of |det|.
void motions(Loop* loop, double* states, double* minima, int count, double duration, double tolerance) {
  const int size = loop->model.nq - 3;
  for (int k = 0; k < count; ++k) {
    VectorXd y = Map<VectorXd>(states + k * size, size);
    minima[k] = loop->integrate(y, duration, tolerance);
    Map<VectorXd>(states + k * size, size) = y;
  }
}
}
