// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// Seeded random points, states and coefficients, degenerate ones among them.
#pragma once

#include <array>
#include <cmath>
#include <dolfinx_contact/law/batch.h>
#include <random>

namespace dolfinx_contact::testing {
inline constexpr double epsilon = std::numeric_limits<double>::epsilon();

class Random {
  public:
    explicit Random(std::uint64_t seed) : engine(seed) {}
    double uniform(double low = 0.0, double high = 1.0) {
        return std::uniform_real_distribution<double>(low, high)(engine);
    }
    double normal() { return std::normal_distribution<double>()(engine); }
    Eigen::VectorXd vector(Eigen::Index size) {
        return Eigen::VectorXd::NullaryExpr(size, [this] { return normal(); });
    }
    Eigen::MatrixXd matrix(Eigen::Index rows, Eigen::Index columns) {
        return Eigen::MatrixXd::NullaryExpr(rows, columns, [this] { return normal(); });
    }
    double power(double low, double high) { return std::pow(10.0, uniform(low, high)); }
    int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(engine); }

    /// Coefficients up to a ratio of 1e8: usual, wildly different, large or small alike.
    template <int T> Tangent<T> coefficients() {
        Tangent<T> mu;
        const double scale = below(2) == 0 ? uniform(0.05, 1.5) : power(-4, 4);
        const double spread = std::array<double, 4>{0.0, 0.5, 2.0, 4.0}[std::size_t(below(4))];
        for (int i = 0; i < T; ++i)
            mu[i] = scale * power(-spread, spread);
        return mu;
    }

    /// Tangential vector of magnitude about 1: any direction, on an axis, nearly so, tiny or zero.
    template <int T> Tangent<T> tangent() {
        Tangent<T> t;
        for (int i = 0; i < T; ++i)
            t[i] = normal();
        switch (below(6)) {
        case 0:
            t[below(T)] = 0.0;
            break;
        case 1:
            t[below(T)] *= power(-20, 0);
            break;
        case 2:
            t *= below(3) == 0 ? 0.0 : power(-20, 0);
            break;
        default:
            break;
        }
        return t;
    }

    /// Point anywhere: inside, outside, on the boundary of the cone or of its polar, at the apex,
    /// on the axis; of magnitude 1.
    template <class Law, int T = Law::tangents> Local<T> point(const Law &law) {
        Local<T> r;
        const Tangent<T> t = tangent<T>();
        r.template head<T>() = t;
        Tangent<T> dual;
        for (int i = 0; i < T; ++i)
            dual[i] = law.mu(i) * t[i];
        switch (below(5)) {
        case 0: { // on the boundary, or within some roundings or a little of it
            r[T] = 0.0;
            r[T] = load_function(law, r);
            break;
        }
        case 1:
            r[T] = -norm<T>(dual);
            break;
        case 2:
            r[T] = normal() * power(-20, 0);
            break;
        default:
            r[T] = normal();
            break;
        }
        if (below(3) == 0)
            r[T] *= 1.0 + normal() * power(-17, -8);
        return r;
    }

    /// Point of the cone: the boundary, or inside.
    template <class Law, int T = Law::tangents> Local<T> reaction(const Law &law) {
        Local<T> r = Local<T>::Zero();
        const Tangent<T> e = tangent<T>();
        const double length = norm<T>(e), R = below(10) == 0 ? 0.0 : uniform(0.0, 2.0);
        const double inside = below(2) == 0 ? 1.0 : uniform();
        for (int i = 0; i < T && length > 0.0; ++i)
            r[i] = law.mu(i) * (R * inside * (e[i] / length));
        r[T] = R;
        return r;
    }

  private:
    std::mt19937_64 engine;
};
} // namespace dolfinx_contact::testing
