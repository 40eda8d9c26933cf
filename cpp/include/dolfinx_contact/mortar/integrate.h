// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
#pragma once

#include <dolfinx_contact/mortar/clip.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace dolfinx_contact {
// Integrals over the common part of two facets that are projected on one plane [M. A. Puso, T. A.
// Laursen, CMAME 193, 2004], or of two intervals: what dual shape functions and the coefficients of
// a mortar method are made of [B. Wohlmuth, SIAM J. Numer. Anal. 38, 2000].

// Shape functions of an interval, triangle or square: monomials s^i t^j times coefficients.
class FacetShapes {
  public:
    static constexpr int Most = 9; // of second order on a square
    using Values = std::array<double, Most>;

    // `coefficients` has a row for each monomial: j runs first, and i + j goes up to the degree on
    // triangles, i and j do on intervals and squares. The degree is 1 or 2.
    FacetShapes(int corners, int degree, const double *coefficients)
        : corners_(corners), degree_(degree), coefficients_(coefficients) {
        for (int i = 0; i <= degree; ++i)
            count_ += corners == 2 ? 1 : corners == 3 ? degree + 1 - i : degree + 1;
    }
    int count() const { return count_; }

    Values at(Point local) const {
        const std::array<double, 3> s{1, local.x, local.x * local.x},
            t{1, local.y, local.y * local.y};
        Values values{};
        const double *row = coefficients_;
        for (std::size_t i = 0; i <= std::size_t(degree_); ++i) {
            const std::size_t last = corners_ == 2   ? 0
                                     : corners_ == 3 ? std::size_t(degree_) - i
                                                     : std::size_t(degree_);
            for (std::size_t j = 0; j <= last; ++j, row += count_)
                for (int k = 0; k < count_; ++k)
                    values[std::size_t(k)] += s[i] * t[j] * row[k];
        }
        return values;
    }

  private:
    int corners_, degree_, count_ = 0;
    const double *coefficients_;
};

// A straight piece of a facet: its corners, in cyclic order, where they are projected to and on the
// reference facet. Intervals have two.
struct FacetPiece {
    static constexpr int MostCorners = 4;
    Polygon<MostCorners> projected, local;

    // Where on the reference facet a point of the piece is.
    Point reference(Point p) const {
        if (projected.count == 2) {
            const double s = (p.x - projected[0].x) / (projected[1].x - projected[0].x);
            return mean({1 - s, s, 0, 0});
        }
        if (projected.count == 3) {
            const double whole = twice_area(projected);
            const double s = twice_area(projected[0], p, projected[2]) / whole;
            const double t = twice_area(projected[0], projected[1], p) / whole;
            return mean({1 - s - t, s, t, 0});
        }
        const Point at = on_square(p);
        const double s = at.x, t = at.y;
        return mean({(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t});
    }

  private:
    Point mean(const std::array<double, MostCorners> &weights) const {
        Point sum{0, 0};
        for (int k = 0; k < local.count; ++k) {
            sum.x += weights[std::size_t(k)] * local[k].x;
            sum.y += weights[std::size_t(k)] * local[k].y;
        }
        return sum;
    }

    // Where the bilinear map of the unit square takes to `p` from: Newton's method.
    Point on_square(Point p) const {
        constexpr int steps = 20;
        constexpr double rounding = 1e-16;
        const Point &a = projected[0], &b = projected[1], &c = projected[2], &d = projected[3];
        const Point u{b.x - a.x, b.y - a.y}, v{d.x - a.x, d.y - a.y};
        const Point w{c.x - b.x - v.x, c.y - b.y - v.y};
        const double bend = std::max(std::abs(w.x), std::abs(w.y));
        const double size = std::max({std::abs(u.x), std::abs(u.y), std::abs(v.x), std::abs(v.y)});
        double s = 0.5, t = 0.5;
        for (int k = 0; k < steps; ++k) {
            const double x = a.x + u.x * s + v.x * t + w.x * s * t - p.x;
            const double y = a.y + u.y * s + v.y * t + w.y * s * t - p.y;
            const Point by_s{u.x + w.x * t, u.y + w.y * t}, by_t{v.x + w.x * s, v.y + w.y * s};
            const double area = by_s.x * by_t.y - by_s.y * by_t.x;
            const double ds = (x * by_t.y - y * by_t.x) / area,
                         dt = (by_s.x * y - by_s.y * x) / area;
            s -= ds, t -= dt;
            if (!(bend * std::abs(ds * dt) > rounding * size)) // what a step leaves of the distance
                break;
        }
        return {s, t};
    }
};

// Points and weights of a rule on the unit interval.
struct LineRule {
    int count;
    const double *at, *weights;
};

// Calls `visit(point, weight)` for a rule on the common part of two pieces: the product rule on
// images of the unit square, quadrilaterals and at most one triangle, with a side that is a point.
template <class Visit>
void on_common_part(const FacetPiece &one, const FacetPiece &other, const LineRule &rule,
                    Visit visit) {
    if (one.projected.count == 2) {
        const auto ends = [](const auto &of) { return std::minmax(of[0].x, of[1].x); };
        const auto a = ends(one.projected), b = ends(other.projected);
        const double low = std::max(a.first, b.first), length = std::min(a.second, b.second) - low;
        for (int i = 0; length > 0 && i < rule.count; ++i)
            visit(Point{low + length * rule.at[i], 0}, length * rule.weights[i]);
        return;
    }
    const auto common = clip(one.projected, other.projected);
    for (int k = 1; k + 1 < common.count; k += 2) {
        const Point &a = common[0], &b = common[k], &c = common[k + 1],
                    &d = common[std::min(k + 2, common.count - 1)];
        for (int i = 0; i < rule.count; ++i)
            for (int j = 0; j < rule.count; ++j) {
                const double s = rule.at[i], t = rule.at[j];
                const Point u{(1 - t) * (b.x - a.x) + t * (c.x - d.x),
                              (1 - t) * (b.y - a.y) + t * (c.y - d.y)};
                const Point v{(1 - s) * (d.x - a.x) + s * (c.x - b.x),
                              (1 - s) * (d.y - a.y) + s * (c.y - b.y)};
                visit(Point{a.x + s * u.x + t * (d.x - a.x), a.y + s * u.y + t * (d.y - a.y)},
                      std::abs(u.x * v.y - u.y * v.x) * rule.weights[i] * rule.weights[j]);
            }
    }
}

// Of the measure, which has a value for each shape function, or is one.
inline double density_at(const double *density, const FacetShapes::Values &N, int count) {
    if (density == nullptr)
        return 1;
    double factor = 0;
    for (int i = 0; i < count; ++i)
        factor += density[i] * N[std::size_t(i)];
    return factor;
}

// Adds int N_i, int N_i N_j and int N_i N'_j over the common part, row by row; false where there is
// none. `density` is that of the one side, see density_at.
inline bool add_common_integrals(const FacetPiece &one, const FacetShapes &N,
                                 const FacetPiece &other, const FacetShapes &others,
                                 const LineRule &rule, const double *density, double *D, double *M,
                                 double *C) {
    const int k = N.count(), m = others.count();
    bool met = false;
    on_common_part(one, other, rule, [&](Point p, double weight) {
        const auto here = N.at(one.reference(p)), there = others.at(other.reference(p));
        weight *= density_at(density, here, k);
        met = true;
        for (int i = 0; i < k; ++i) {
            const double value = weight * here[std::size_t(i)];
            D[i] += value;
            for (int j = 0; j < k; ++j)
                M[k * i + j] += value * here[std::size_t(j)];
            for (int j = 0; j < m; ++j)
                C[m * i + j] += value * there[std::size_t(j)];
        }
    });
    return met;
}
} // namespace dolfinx_contact
