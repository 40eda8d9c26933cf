// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

namespace dolfinx_contact {
// A straight piece of a facet in space: a whole one, or a quarter of a curved one. In two
// dimensions the last coordinate is zero.
struct PieceInSpace {
    static constexpr int MostCorners = 4;
    std::array<Eigen::Vector3d, MostCorners> x; // corners, in cyclic order
    int count = 0;
    Eigen::Vector3d normal, middle; // normal: away from the body
    double radius = 0;              // of the corners about the middle

    // With corners known; `outwards` is the side of the facet that is away from the body.
    void complete(bool in_plane, const Eigen::Vector3d &outwards) {
        middle.setZero();
        for (int k = 0; k < count; ++k)
            middle += x[std::size_t(k)] / count;
        for (int k = 0; k < count; ++k)
            radius = std::max(radius, (x[std::size_t(k)] - middle).norm());
        const Eigen::Vector3d along = x[1] - x[0];
        if (in_plane)
            normal = {along.y(), -along.x(), 0};
        else
            normal = count == 3 ? along.cross(x[2] - x[0]) : (x[2] - x[0]).cross(x[3] - x[1]);
        if (normal.norm() > 0)
            normal /= normal.dot(outwards) < 0 ? -normal.norm() : normal.norm();
    }
};

// Which pieces may have a common part with another one: near it, as near as any, and facing it.
class NearPieces {
  public:
    // Cosine of the angle between normals beyond which pieces do not face each other.
    static constexpr double facing = -0.1;

    explicit NearPieces(const std::vector<PieceInSpace> &pieces) : pieces_(pieces) {
        Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
        Eigen::Array3d high = -low;
        for (const auto &piece : pieces) {
            low = low.min(piece.middle.array()), high = high.max(piece.middle.array());
            most_ = std::max(most_, piece.radius);
        }
        if (!pieces.empty())
            (high - low).maxCoeff(&axis_);
        order_.resize(pieces.size());
        std::iota(order_.begin(), order_.end(), std::size_t(0));
        std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
            return pieces[a].middle[axis_] < pieces[b].middle[axis_];
        });
        for (const std::size_t k : order_)
            at_.push_back(pieces[k].middle[axis_]);
    }

    template <class Visit> void each(const PieceInSpace &one, Visit visit) const {
        constexpr double room = 1.01;
        const double reach = room * (nearest(one) + one.radius + 2 * most_);
        const double low = one.middle[axis_] - reach, high = one.middle[axis_] + reach;
        for (std::size_t i = first(low); i < at_.size() && at_[i] <= high; ++i) {
            const auto &other = pieces_[order_[i]];
            if ((other.middle - one.middle).norm() <= reach &&
                one.normal.dot(other.normal) < facing)
                visit(order_[i]);
        }
    }

  private:
    const std::vector<PieceInSpace> &pieces_;
    std::vector<std::size_t> order_; // along the axis in which they extend most
    std::vector<double> at_;         // where they are there
    Eigen::Index axis_ = 0;
    double most_ = 0; // radius

    std::size_t first(double at) const {
        return std::size_t(std::lower_bound(at_.begin(), at_.end(), at) - at_.begin());
    }

    // Distance of the middle that is nearest.
    double nearest(const PieceInSpace &one) const {
        const double here = one.middle[axis_];
        const std::size_t start = first(here);
        double least = std::numeric_limits<double>::infinity();
        const auto look = [&](std::size_t i) {
            least = std::min(least, (pieces_[order_[i]].middle - one.middle).norm());
        };
        for (std::size_t i = start; i < at_.size() && at_[i] - here < least; ++i)
            look(i);
        for (std::size_t i = start; i-- > 0 && here - at_[i] < least;)
            look(i);
        return least;
    }
};
} // namespace dolfinx_contact
