// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_nodal.h
/// One contact, w = q + A r, solved exactly: an equation for the direction of slip.
#pragma once

#include "condensed_system.h"
#include <array>
#include <utility>

namespace dolfinx_contact::condensed {
/// The roots on the circle of g0 + g1 cos t + h1 sin t + g2 cos 2t + h2 sin 2t: at most four.
template <class Scalar> struct Trigonometric {
    Scalar g0, g1, h1, g2, h2;

    /// Value, or derivative, at e = (cos t, sin t).
    template <class E> Scalar value(const E &e) const {
        const Scalar c2 = e[0] * e[0] - e[1] * e[1], s2 = 2 * e[0] * e[1];
        return g0 + g1 * e[0] + h1 * e[1] + g2 * c2 + h2 * s2;
    }
    Trigonometric derivative() const { return {0, h1, -g1, 2 * h2, -2 * g2}; }

    static std::array<Scalar, 2> at(Scalar t) { return {std::cos(t), std::sin(t)}; }

    /// A zero between angles at which signs differ, by bisection and secants in turn.
    Scalar zero(Scalar low, Scalar high) const {
        Scalar left = value(at(low)), right = value(at(high));
        for (int k = 0; k < 200 && high > low; ++k) {
            Scalar middle =
                k % 2 == 0 ? high - right * (high - low) / (right - left) : low + (high - low) / 2;
            if (!(middle > low && middle < high))
                middle = low + (high - low) / 2;
            if (middle == low || middle == high)
                break;
            const Scalar here = value(at(middle));
            if (here == 0)
                return middle;
            const bool same = (here > 0) == (left > 0);
            (same ? low : high) = middle;
            (same ? left : right) = here;
        }
        return std::abs(left) < std::abs(right) ? low : high;
    }

    /// Angles of all roots; close pairs are told by an extremum between them, and one that does not
    /// reach zero is given, too: it may be a double root that rounding took away.
    std::vector<Scalar> roots() const {
        constexpr int parts = 48;
        const Scalar step = 8 * std::atan(Scalar(1)) / parts;
        static const auto points = [&] { // they are the same for every equation
            std::array<std::array<Scalar, 2>, parts + 1> found;
            for (int k = 0; k <= parts; ++k)
                found[static_cast<std::size_t>(k)] = at(k * step);
            return found;
        }();
        std::vector<Scalar> found;
        const Trigonometric slope = derivative();
        Scalar left = value(points[0]), left_slope = slope.value(points[0]);
        for (int k = 0; k < parts; ++k) {
            const auto &next = points[static_cast<std::size_t>(k) + 1];
            const Scalar low = k * step, high = (k + 1) * step;
            const Scalar right = value(next), right_slope = slope.value(next);
            if (left == 0)
                found.push_back(low);
            else if ((left > 0) != (right > 0)) {
                found.push_back(zero(low, high));
            } else if (left_slope * left < 0 && right_slope * left > 0) {
                const Scalar turn = slope.zero(low, high);
                if (value(at(turn)) * left < 0) {
                    found.push_back(zero(low, turn));
                    found.push_back(zero(turn, high));
                } else
                    found.push_back(turn);
            }
            left = right;
            left_slope = right_slope;
        }
        return found;
    }
};

/// A contact in scaled variables: the isotropic law with unit friction, A of any kind.
template <int T, class Scalar = double> class Nodal {
  public:
    static constexpr int D = T + 1;
    using Vector = Eigen::Matrix<Scalar, D, 1>;
    using Matrix = Eigen::Matrix<Scalar, D, D>;

    Nodal(Matrix A, bool smooth) : A_(std::move(A)), smooth_(smooth || T == 0) {
        if constexpr (T > 0) {
            const Eigen::FullPivLU<Matrix> lu(A_);
            regular_ = lu.isInvertible();
            if (regular_)
                inverse_ = lu.solve(Matrix::Identity());
        }
    }

    /// Reactions of all states that can be the solution, the likeliest first: open; sticking; the
    /// slips in either direction.
    std::vector<Vector> candidates(const Vector &q) const {
        std::vector<Vector> found;
        if (q[T] >= 0)
            found.push_back(Vector::Zero());
        if (smooth_) {
            found.push_back(Vector::Unit(T) * (-q[T] / A_(T, T)));
            return found;
        }
        if (regular_)
            found.push_back(-inverse_ * q);
        else
            found.push_back(least_stick(q));
        add_slips(q, found);
        return found;
    }

    /// The solution, of several the one nearest to r; false if there is none but for rounding.
    bool solve(const Vector &q, Vector &r) const {
        if (q[T] >= 0) {
            r.setZero();
            return true;
        }
        if (!smooth_ && regular_) {
            const Vector stick = -inverse_ * q;
            if (stick.template head<T>().norm() <= stick[T]) {
                r = stick;
                return true;
            }
        }
        Scalar nearest = std::numeric_limits<Scalar>::infinity();
        const Vector before = r;
        std::vector<Vector> slips;
        if (smooth_)
            slips.push_back(Vector::Unit(T) * (-q[T] / A_(T, T)));
        else
            add_slips(q, slips);
        for (const Vector &slip : slips)
            if (const Scalar distance = (slip - before).norm(); distance < nearest) {
                nearest = distance;
                r = slip;
            }
        return std::isfinite(nearest);
    }

  private:
    /// The smallest sticking reaction of a singular A, in double precision.
    Vector least_stick(const Vector &q) const {
        const MatrixXd A = A_.template cast<double>();
        const VectorXd right = q.template cast<double>();
        VectorXd stick(right.size());
        linear_algebra().least_squares(view(A), view(right), result(stick));
        return -stick.template cast<Scalar>();
    }

    /// r = n (e, 1) with w_n = 0 and w_t along -e: w_t x e = 0 times A_nn + A_nt e is trigonometric
    /// in the angle of e.
    void add_slips(const Vector &q, std::vector<Vector> &found) const {
        if constexpr (T == 1) {
            for (const Scalar e : {Scalar(1), Scalar(-1)})
                add_slip(q, Eigen::Matrix<Scalar, T, 1>::Constant(e), found);
        } else if constexpr (T == 2) {
            const Scalar a = A_(2, 0), b = A_(2, 1), x = q[0], y = q[1], n = q[2];
            const Trigonometric<Scalar> g{(b * x - a * y - n * (A_(0, 1) - A_(1, 0))) / 2,
                                          -A_(2, 2) * y + n * A_(1, 2), A_(2, 2) * x - n * A_(0, 2),
                                          (-b * x - a * y + n * (A_(0, 1) + A_(1, 0))) / 2,
                                          (a * x - b * y - n * (A_(0, 0) - A_(1, 1))) / 2};
            for (const Scalar angle : g.roots())
                add_slip(q, Eigen::Matrix<Scalar, T, 1>(std::cos(angle), std::sin(angle)), found);
        }
    }
    void add_slip(const Vector &q, const Eigen::Matrix<Scalar, T, 1> &e,
                  std::vector<Vector> &found) const {
        Vector r;
        r.template head<T>() = e;
        r[T] = 1;
        r *= -q[T] / A_.row(T).dot(r);
        const Vector w = q + A_ * r;
        if (r[T] > 0 && r.allFinite() && w.template head<T>().dot(e) <= 0)
            found.push_back(r);
    }

    Matrix A_, inverse_;
    bool smooth_, regular_ = false;
};
} // namespace dolfinx_contact::condensed
