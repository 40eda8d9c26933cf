// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_path.h
/// A path of solutions of smoothed problems, followed by its arc length through the points where it
/// turns back, where methods stop that let a parameter fall. A start for Newton's method.
#pragma once

#include "condensed_blocks.h"
#include "condensed_newton.h"
#include "condensed_starts.h"

namespace dolfinx_contact::condensed {
/// A problem with a parameter s from 0 to 1, of z = r - y where r and y are in the cone
/// C = {|v_t| <= v_n} and r o y = eps^2 / 4 e_n:
///   q + W r = (y_t, y_n - c).
/// On the first part c goes from a given a to |y_t|^2 / y_n, which is |y_t| on the boundary of C,
/// as (1 - s) a + s |y_t|^2 / y_n, and s = 0 is convex. On the second part eps goes to zero.
template <int T> class Smoothed {
  public:
    static constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;
    using Block = Eigen::Matrix<double, D, D>;
    enum class Part { correction, smoothing };

    /// Units are those of r, which is not zero, and a is near its |w_t|, at random.
    Smoothed(const System<T> &system, const VectorXd &r, std::minstd_rand &random)
        : root(std::sqrt(static_cast<double>(system.size()))), system_(system), linear_(system) {
        constexpr double part = 1e-2;
        const double nodes = std::sqrt(static_cast<double>(system.nodes));
        force_ = r.norm() / nodes;
        length_ = system.left.cwiseProduct(system.q).norm() / nodes;
        const VectorXd w = system.displacement(r) / length_;
        start.resize(system.size() + 1);
        start << r / force_ - w, 0.0;
        a_.resize(system.nodes);
        for (Index i = 0; i < system.nodes; ++i) {
            const double slip = at(w, i).template head<T>().norm();
            start[D * i + T] -= slip;
            a_[i] = slip * (1.0 + part * (2.0 * uniform(random) - 1.0)) + part * uniform(random);
        }
    }

    /// What is left of the equation at x = (z, root s), and what its derivatives need.
    void evaluate(const VectorXd &x) {
        const VectorXd z = x.head(system_.size());
        const double s = x[system_.size()] / root;
        const bool first = part == Part::correction;
        weight_ = first ? s : 1.0;
        const double ratio = std::log(eps_last / eps_first);
        const double eps = first ? eps_first : eps_first * std::exp(ratio * s);
        r_.resize(z.size());
        VectorXd rate(z.size());
        B_.resize(static_cast<std::size_t>(system_.nodes));
        for (Index i = 0; i < system_.nodes; ++i) {
            Node r, by_eps;
            smooth(at(z, i), eps, r, by_eps, B_[static_cast<std::size_t>(i)]);
            r_.segment<D>(D * i) = r;
            rate.segment<D>(D * i) = by_eps;
        }
        y_ = r_ - z;
        rest = system_.displacement(force_ * r_) / length_ - y_;
        by_s.setZero(z.size());
        if (!first)
            by_s = eps * ratio * (compliance(rate) - correct(rate));
        for (Index i = 0; i < system_.nodes; ++i) {
            const Node y = at(y_, i);
            const double c = y.template head<T>().squaredNorm() / y[T];
            rest[D * i + T] += (1.0 - weight_) * a_[i] + weight_ * c;
            if (first)
                by_s[D * i + T] = c - a_[i];
        }
    }
    /// Of the state evaluated last; false if they do not exist.
    bool factors() {
        typename BlockSolver<T>::Blocks A(B_.size());
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto k = static_cast<std::size_t>(i);
            const Eigen::Matrix<double, T, 1> t = at(y_, i).template head<T>() / y_[D * i + T];
            Block E = Block::Identity();
            E.row(T).template head<T>() -= 2.0 * weight_ * t.transpose();
            E(T, T) += weight_ * t.squaredNorm();
            A[k] = length_ / force_ * E * (Block::Identity() - B_[k]);
        }
        return linear_.factor(A, &B_);
    }
    /// dz of W B dz - E (B - I) dz = -rest, with the last factors.
    VectorXd solution(const VectorXd &rest) { return linear_.solve(-length_ / force_ * rest); }
    VectorXd reactions() const { return force_ * r_; }

    Part part = Part::correction;
    const double root; ///< by which s counts as much as all of z
    VectorXd start;    ///< (z, root s)
    VectorXd rest;     ///< what is left of the equation
    VectorXd by_s;     ///< its derivative

  private:
    static constexpr double eps_first = 1e-2, eps_last = 1e-6;
    static Node at(const VectorXd &v, Index i) { return v.template segment<D>(D * i); }

    /// r of a node, its derivatives with respect to eps and, B, to z.
    static void smooth(const Node &z, double eps, Node &r, Node &by_eps, Block &B) {
        const double t = z.template head<T>().norm();
        Eigen::Matrix<double, T, 1> d = Eigen::Matrix<double, T, 1>::Unit(0);
        if (t > 0.0)
            d = z.template head<T>() / t;
        double value[2], rate[2], slope[2];
        for (int k : {0, 1}) { // (l + sqrt(l^2 + eps^2)) / 2 of both spectral values l
            const double l = z[T] + (k == 0 ? -t : t), size = std::hypot(l, eps);
            value[k] = l > 0.0 ? 0.5 * (l + size) : 0.5 * eps * eps / (size - l);
            rate[k] = 0.5 * eps / size;
            slope[k] = value[k] / size;
        }
        const auto spectral = [&](const double *f) {
            Node v;
            v.template head<T>() = 0.5 * (f[1] - f[0]) * d;
            v[T] = 0.5 * (f[0] + f[1]);
            return v;
        };
        r = spectral(value);
        by_eps = spectral(rate);
        const Node column = spectral(slope);
        const double across = t > 0.0 ? 0.5 * (value[1] - value[0]) / t : column[T];
        B.template topLeftCorner<T, T>() = across * Eigen::Matrix<double, T, T>::Identity() +
                                           (column[T] - across) * d * d.transpose();
        B.col(T) = column;
        B.row(T) = column.transpose();
    }

    VectorXd compliance(const VectorXd &dr) const { return system_.change(force_ * dr) / length_; }
    /// E dy, the change of w.
    VectorXd correct(VectorXd v) const {
        for (Index i = 0; i < system_.nodes; ++i) {
            const Eigen::Matrix<double, T, 1> t = at(y_, i).template head<T>() / y_[D * i + T];
            const double along = t.dot(at(v, i).template head<T>());
            v[D * i + T] += weight_ * (t.squaredNorm() * v[D * i + T] - 2.0 * along);
        }
        return v;
    }

    const System<T> &system_;
    BlockSolver<T> linear_;
    double force_, length_; // units of r and y
    double weight_ = 0.0;   // of c, beside a
    VectorXd a_, r_, y_;
    std::vector<Block> B_; // of r with respect to z
};

/// The path of solutions from s = 0 to 1 of both parts. For almost every a the first one does not
/// end before if W is symmetric and positive semidefinite [S. N. Chow, J. Mallet-Paret, J. A.
/// Yorke, Math. Comp. 32 (1978); V. Acary, F. Cadoux, C. Lemarechal, J. Malick, ZAMM 91 (2011)].
/// Predictor and corrector by E. L. Allgower, K. Georg, Numerical Continuation Methods, Springer
/// (1990).
template <int T> class Path {
  public:
    Path(const System<T> &system, const VectorXd &r, std::minstd_rand &random, Budget &budget)
        : system_(system), at_(system, r, random), x_(at_.start), budget_(budget) {}

    /// Whether it is followed through the first part. Where the second one ends too early rounding
    /// may be the reason: Newton's method decides.
    bool run() {
        if (!settle() || !follow())
            return false;
        at_.part = Smoothed<T>::Part::smoothing;
        follow();
        return true;
    }
    VectorXd reactions() const { return at_.reactions(); }

  private:
    /// Newton's method at s = 0 with a line search.
    bool settle() {
        constexpr int most = 60;
        constexpr double accuracy = 1e-8, shortest = 1e-6, decrease = 0.1;
        at_.evaluate(x_);
        for (int k = 0; k < most && !budget_.spent(); ++k, ++budget_.iterations) {
            const double size = at_.rest.norm();
            if (!at_.factors())
                return false;
            VectorXd dx = VectorXd::Zero(x_.size());
            dx.head(system_.size()) = at_.solution(at_.rest);
            if (dx.norm() < accuracy * x_.norm())
                return true;
            double length = 2.0;
            do {
                length *= 0.5;
                at_.evaluate(x_ + length * dx);
            } while (!(at_.rest.norm() < (1.0 - decrease * length) * size) && length > shortest);
            x_ += length * dx;
        }
        return false;
    }

    /// Newton's method from x, `h` along the path from the last point, back to it in the plane
    /// across a vector. Factors serve as long as it converges well. Returns the number of
    /// corrections, or none where it went too far for a path that is followed; the path's direction
    /// in `next`.
    int correct(VectorXd &x, const VectorXd &across, double h, VectorXd &next) {
        constexpr int most = 8;
        constexpr double contraction = 0.5, good = 0.3, farthest = 0.5, rounding = 1e-12;
        double before = h, moved = 0.0;
        bool fresh = true;
        for (int k = 1; k <= most && !budget_.spent(); ++k) {
            at_.evaluate(x);
            if (fresh && (++budget_.iterations, !at_.factors()))
                return 0;
            if (k == 1) {
                next.resize(x.size());
                next << at_.solution(at_.by_s) / at_.root, 1.0;
            }
            if (at_.rest.norm() < rounding * x.norm()) {
                next.normalize();
                return k;
            }
            VectorXd dx(x.size());
            dx << at_.solution(at_.rest), 0.0;
            dx -= across.dot(dx) / across.dot(next) * next;
            const double size = dx.norm();
            if (!(size <= (fresh ? contraction : good) * before)) {
                if (fresh)
                    return 0;
                fresh = true;
                continue;
            }
            fresh = false;
            x += dx;
            moved += size;
            if (moved > farthest * h)
                return 0;
            if (size < std::min(1e-3 * h, 1e-4)) {
                next.normalize();
                return k;
            }
            before = size;
        }
        return 0;
    }

    /// From s = 0 to 1; steps are as long as corrections and turns are small.
    bool follow() {
        constexpr int most = 1000;
        constexpr double shortest = 1e-7, first = 0.1, sharpest = 0.8;
        const Index m = system_.size();
        const VectorXd fixed = VectorXd::Unit(m + 1, m);
        VectorXd next, tangent(m + 1);
        x_[m] = 0.0;
        at_.evaluate(x_);
        if (!at_.factors())
            return false;
        tangent << at_.solution(at_.by_s) / at_.root, 1.0;
        tangent.normalize();
        const int start = budget_.iterations;
        for (double h = first; h > shortest && budget_.iterations < start + most;) {
            const double left = (at_.root - x_[m]) / tangent[m];
            const bool last = left > 0.0 && left <= h;
            VectorXd x = x_ + (last ? left : h) * tangent;
            const int corrections = correct(x, last ? fixed : tangent, h, next);
            if (budget_.spent())
                return false;
            const double turn = corrections > 0 ? next.dot(tangent) : 0.0;
            if (std::abs(turn) < sharpest && !(last && corrections > 0)) {
                h *= 0.4;
                continue;
            }
            x_ = x;
            budget_.tell(system_, at_.reactions());
            if (last)
                return true;
            tangent = turn > 0.0 ? next : VectorXd(-next);
            if (corrections <= 3 && std::abs(turn) > 0.97)
                h *= 1.7;
            else if (corrections <= 4 && std::abs(turn) > 0.9)
                h *= 1.2;
            else if (corrections > 5)
                h *= 0.7;
        }
        return false;
    }

    const System<T> &system_;
    Smoothed<T> at_;
    VectorXd x_;
    Budget &budget_;
};
} // namespace dolfinx_contact::condensed
