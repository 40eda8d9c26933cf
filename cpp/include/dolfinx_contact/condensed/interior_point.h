// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file interior_point.h
/// Primal-dual interior point method for second-order cones: it needs no rank of W and finds its
/// way through very many states of contacts. A start for Newton's method.
#pragma once

#include "budget.h"
#include <algorithm>
#include <memory>

namespace dolfinx_contact::condensed {
/// r and y in the cone C = {|v_t| <= v_n}, orthogonal, and (y_t, y_n - |y_t|^2 / y_n) = q + W r.
/// This is the law, since y_n = |y_t| on the boundary of C, and smooth inside. Predictor and
/// corrector [S. Mehrotra, SIAM J. Optim. 2 (1992)] in the scaling of Y. E. Nesterov and M. J. Todd
/// [SIAM J. Optim. 8 (1998)]. Tied rows are linear equations, q + W r = 0. Of a contact without
/// friction r_t and y_t stay zero.
template <int T> class InteriorPoint {
  public:
    static constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;
    using Block = Eigen::Matrix<double, D, D>;

    explicit InteriorPoint(const System<T> &system)
        : system_(system), linear_(system.W->algebra().solver(*system.poll)) {}

    /// Reactions near a solution, or where steps have become too short. Begins at r = y = e_n,
    /// whatever starts there are: they are no use on the boundary of the cone.
    VectorXd run(Budget &budget) {
        const auto n = static_cast<double>(system_.nodes);
        r_ = VectorXd::Zero(system_.size());
        for (Index i = 0; i < system_.nodes; ++i)
            r_[D * i + T] = 1.0;
        y_ = r_;
        for (int k = 0; k < Tuning::interior_iterations && !budget.spent();
             ++k, ++budget.iterations) {
            linearise();
            budget.tell(system_, r_);
            const double gap = r_.dot(y_) / n, size = r_.head(D * system_.nodes).norm();
            if (rest_.norm() < Tuning::interior_accuracy * size &&
                gap < Tuning::interior_accuracy * std::max(1.0, size / std::sqrt(n)))
                break;
            VectorXd dr, dy;
            if (!direction(0.0, dr, dy, dr, dy))
                break;
            const double reach = std::min({1.0, longest(r_, dr), longest(y_, dy)});
            const double after = (r_ + reach * dr).dot(y_ + reach * dy) / n;
            const double centre =
                std::clamp(std::pow(after / gap, Tuning::centring), Tuning::least_centring, 1.0);
            VectorXd first = dr, second = dy;
            direction(centre * gap, first, second, dr, dy);
            const double length =
                std::min({1.0, Tuning::inside * longest(r_, dr), Tuning::inside * longest(y_, dy)});
            const VectorXd r = r_ + length * dr, y = y_ + length * dy;
            if (!(length > Tuning::interior_shortest) || !interior(r) || !interior(y))
                break;
            r_ = r;
            y_ = y;
        }
        return r_;
    }

  private:
    static double det(const Node &v) {
        const double t = v.template head<T>().norm();
        return (v[T] - t) * (v[T] + t);
    }
    /// v o x, the product of which e_n is the unit.
    static Node product(const Node &v, const Node &x) {
        Node found = v[T] * x + x[T] * v;
        found[T] = v.dot(x);
        return found;
    }
    /// x of v o x = b.
    static Node quotient(const Node &v, const Node &b) {
        Node x;
        x[T] = (v[T] * b[T] - v.template head<T>().dot(b.template head<T>())) / det(v);
        x.template head<T>() = (b.template head<T>() - x[T] * v.template head<T>()) / v[T];
        return x;
    }
    bool smooth(Index i) const { return system_.smooth[static_cast<std::size_t>(i)]; }
    static Node at(const VectorXd &v, Index i) { return v.template segment<D>(D * i); }
    bool interior(const VectorXd &v) const {
        for (Index i = 0; i < system_.nodes; ++i)
            if (!(v[D * i + T] > 0.0 && det(at(v, i)) > 0.0))
                return false;
        return v.allFinite();
    }

    /// The largest a of which v + a dv is in the cone.
    double longest(const VectorXd &v, const VectorXd &dv) const {
        double found = std::numeric_limits<double>::infinity();
        for (Index i = 0; i < system_.nodes; ++i) {
            const Node x = at(v, i), d = at(dv, i);
            const double a = d[T] * d[T] - d.template head<T>().squaredNorm(), c = det(x),
                         b = x[T] * d[T] - x.template head<T>().dot(d.template head<T>()),
                         root2 = b * b - a * c;
            if (root2 >= 0.0 && std::sqrt(root2) > b) // c + 2 b t + a t^2 = 0
                found = std::min(found, c / (std::sqrt(root2) - b));
            if (d[T] < 0.0)
                found = std::min(found, -x[T] / d[T]);
        }
        return found;
    }

    /// What is left of the equations; P with P r = P^-1 y; E, the derivative of w with respect to
    /// y.
    void linearise() {
        const VectorXd w = system_.displacement(r_);
        rest_ = w; // that of tied rows
        for (auto *blocks : {&P_, &inverse_, &E_})
            blocks->resize(static_cast<std::size_t>(system_.nodes));
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto k = static_cast<std::size_t>(i);
            const Node r = at(r_, i), y = at(y_, i);
            const Eigen::Matrix<double, T, 1> t = y.template head<T>() / y[T];
            rest_.segment<D>(D * i) = at(w, i) - y;
            if (smooth(i))
                rest_.segment<T>(D * i).setZero();
            rest_[D * i + T] += y[T] * t.squaredNorm();
            E_[k].setIdentity();
            E_[k].row(T).template head<T>() = -2.0 * t.transpose();
            E_[k](T, T) += t.squaredNorm();
            const double size_r = std::sqrt(det(r)), size_y = std::sqrt(det(y));
            const Node unit_r = r / size_r, unit_y = y / size_y;
            Node s = unit_y - unit_r;
            s[T] = unit_y[T] + unit_r[T];
            s /= std::sqrt(2.0 * (1.0 + unit_r.dot(unit_y)));
            Block P = Block::Identity();
            P.template topLeftCorner<T, T>() +=
                s.template head<T>() * s.template head<T>().transpose() / (1.0 + s[T]);
            P.col(T) = s;
            P.row(T) = s.transpose();
            const double stretch = std::sqrt(size_y / size_r);
            P_[k] = stretch * P;
            P.row(T).template head<T>() *= -1.0;
            P.col(T).template head<T>() *= -1.0;
            inverse_[k] = P / stretch;
        }
    }

    /// The step towards r o y = `target` e_n from E dy = W dr + rest, P^-1 dy + P dr = c. A target
    /// above zero is of the corrector, which has the predictor's products and factors.
    bool direction(double target, const VectorXd &predicted_r, const VectorXd &predicted_y,
                   VectorXd &dr, VectorXd &dy) {
        VectorXd c = VectorXd::Zero(r_.size()), rhs = -rest_;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto k = static_cast<std::size_t>(i);
            const Node lambda = P_[k] * at(r_, i);
            Node b = -product(lambda, lambda);
            if (target > 0.0) {
                b[T] += target;
                b -= product(P_[k] * at(predicted_r, i), inverse_[k] * at(predicted_y, i));
            }
            c.segment<D>(D * i) = P_[k] * quotient(lambda, b);
            rhs.segment<D>(D * i) += E_[k] * at(c, i);
        }
        if (target == 0.0)
            factors();
        dr = linear_->again(rhs);
        if (!dr.allFinite())
            return false;
        dy = c;
        for (Index i = 0; i < system_.nodes; ++i) {
            if (smooth(i)) // what stands there is the slip
                dr.template segment<T>(D * i).setZero();
            const auto &P = P_[static_cast<std::size_t>(i)];
            dy.segment<D>(D * i) -= P * (P * at(dr, i));
        }
        return true;
    }

    /// Of W + E P^2.
    void factors() {
        MatrixXd J = system_.left.asDiagonal() * system_.W->dense() * system_.right.asDiagonal();
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto k = static_cast<std::size_t>(i);
            if (smooth(i))
                J.middleCols<T>(D * i).setZero();
            J.block<D, D>(D * i, D * i) += E_[k] * P_[k] * P_[k];
        }
        linear_->factor(J);
    }

    const System<T> &system_;
    std::unique_ptr<LinearSolver> linear_;
    VectorXd r_, y_, rest_;
    std::vector<Block> P_, inverse_, E_;
};
} // namespace dolfinx_contact::condensed
