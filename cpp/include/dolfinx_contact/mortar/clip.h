// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

namespace dolfinx_contact {
// The part that two convex polygons in the plane have in common, one edge after another [I. E.
// Sutherland, G. W. Hodgman, Commun. ACM 17, 1974]. In a mortar method they are a facet and the
// projection of one of the opposite surface [M. A. Puso, T. A. Laursen, CMAME 193, 2004].
struct Point {
    double x, y;
};

// Corners of at most MaxCorners, in order.
template <int MaxCorners> struct Polygon {
    std::array<Point, MaxCorners> corners;
    int count = 0;

    // One that is beyond the room, of a polygon that is not convex, is left out.
    void add(Point p) {
        if (count < MaxCorners)
            corners[static_cast<std::size_t>(count++)] = p;
    }
    const Point &operator[](int k) const { return corners[static_cast<std::size_t>(k)]; }
};

// Twice the area of a triangle, positive if its corners are in counter-clockwise order.
inline double twice_area(Point a, Point b, Point c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

template <int N> double twice_area(const Polygon<N> &polygon) {
    double sum = 0;
    for (int k = 1; k + 1 < polygon.count; ++k)
        sum += twice_area(polygon[0], polygon[k], polygon[k + 1]);
    return sum;
}

// Whether the boxes around two polygons have no area in common: seen at once of most that have
// none.
template <int N, int M> bool apart(const Polygon<N> &one, const Polygon<M> &other) {
    const auto within = [](const auto &of, double Point::*along) {
        double low = of[0].*along, high = low;
        for (int k = 1; k < of.count; ++k) {
            low = std::min(low, of[k].*along);
            high = std::max(high, of[k].*along);
        }
        return std::pair(low, high);
    };
    const auto clear = [&](double Point::*along) {
        const auto a = within(one, along), b = within(other, along);
        return a.second < b.first || b.second < a.first;
    };
    return clear(&Point::x) || clear(&Point::y);
}

// What of a polygon is to the left of the line from a to b.
template <int N> Polygon<N> left_of(const Polygon<N> &polygon, Point a, Point b) {
    Polygon<N> kept;
    for (int k = 0; k < polygon.count; ++k) {
        const Point p = polygon[k], q = polygon[(k + 1) % polygon.count];
        const double at_p = twice_area(a, b, p), at_q = twice_area(a, b, q);
        if (at_p >= 0)
            kept.add(p);
        if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) {
            const double t = at_p / (at_p - at_q);
            kept.add({p.x + t * (q.x - p.x), p.y + t * (q.y - p.y)});
        }
    }
    return kept;
}

// The common part; none where it has no area. `by` may have either order of corners.
template <int N, int M> Polygon<N + M> clip(const Polygon<N> &polygon, const Polygon<M> &by) {
    Polygon<N + M> common;
    for (int k = 0; k < polygon.count; ++k)
        common.add(polygon[k]);
    const bool turned = twice_area(by) < 0;
    for (int k = 0; k < by.count && common.count > 2; ++k) {
        const Point a = by[k], b = by[(k + 1) % by.count];
        common = turned ? left_of(common, b, a) : left_of(common, a, b);
    }
    if (common.count < 3 || twice_area(common) == 0)
        common.count = 0;
    return common;
}
} // namespace dolfinx_contact
