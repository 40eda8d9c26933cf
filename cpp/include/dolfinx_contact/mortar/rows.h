// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
#pragma once

#include <dolfinx_contact/mortar/integrate.h>
#include <dolfinx_contact/mortar/near.h>

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace dolfinx_contact {
// Rows of a dual mortar method. From the common parts of a slave facet e with the facets of the
// other side follow M_e = int N N^T, D_e = diag(int N) and the dual shape functions
// psi = D_e M_e^-1 N [A. Cichosz, M. Bischoff, CMAME 200, 2011], and with them int psi_a N_b.

// Facets of one shape of one side; arrays row by row.
struct MortarSide {
    int dim; // of space
    std::size_t facets;
    int nodes, corners, degree;  // of a facet
    std::size_t parts;           // into how many straight pieces it is cut
    const double *x;             // where the nodes are, (facets, nodes, dim)
    const double *outwards;      // unit normals, away from the body, (facets, dim)
    const std::int64_t *numbers; // rows or columns of the nodes, negative is none, (facets, nodes)
    const double *local;         // nodes on the reference facet, (nodes, dim - 1)
    const std::int64_t
        *cuts; // nodes at the corners of each piece, in cyclic order, (parts, corners)
    const double *coefficients; // of the shape functions, (nodes, nodes)
    const double *density;      // of the measure at the nodes, (facets, nodes), or null

    FacetShapes shapes() const { return {corners, degree, coefficients}; }
    std::int64_t number(std::size_t facet, int node) const {
        return numbers[facet * std::size_t(nodes) + std::size_t(node)];
    }
    Eigen::Vector3d in_space(const double *row) const {
        return {row[0], row[1], dim == 3 ? row[2] : 0.0};
    }
    int node(std::size_t part, int corner) const {
        return int(cuts[part * std::size_t(corners) + std::size_t(corner)]);
    }
    // The pieces of one facet after the other.
    std::vector<PieceInSpace> pieces() const {
        std::vector<PieceInSpace> found(facets * parts);
        const auto d = std::size_t(dim), k = std::size_t(nodes);
        for (std::size_t p = 0; p < found.size(); ++p) {
            const std::size_t facet = p / parts;
            found[p].count = corners;
            for (int c = 0; c < corners; ++c) {
                const double *row = x + d * (facet * k + std::size_t(node(p % parts, c)));
                found[p].x[std::size_t(c)] = in_space(row);
            }
            found[p].complete(dim == 2, in_space(outwards + d * facet));
        }
        return found;
    }
    Polygon<FacetPiece::MostCorners> on_reference(std::size_t part) const {
        Polygon<FacetPiece::MostCorners> at;
        for (int c = 0; c < corners; ++c) {
            const double *row = local + (dim - 1) * node(part, c);
            at.add({row[0], dim == 3 ? row[1] : 0.0});
        }
        return at;
    }
};

// How far a quadrilateral is from a parallelogram, over its size.
inline double bent(const Polygon<FacetPiece::MostCorners> &of) {
    if (of.count < 4)
        return 0;
    double size = 0;
    for (int k = 1; k < 4; ++k)
        size = std::max({size, std::abs(of[k].x - of[0].x), std::abs(of[k].y - of[0].y)});
    const double x = of[0].x - of[1].x + of[2].x - of[3].x;
    const double y = of[0].y - of[1].y + of[2].y - of[3].y;
    return size > 0 ? std::max(std::abs(x), std::abs(y)) / size : 0;
}

// Of the rules, each with more points than the one before, the first that integrates products of
// both sides' shape functions exactly, with as much more as makes twelve digits where inverse maps
// of quadrilaterals are no polynomials, or the last.
inline const LineRule &rule_for(const FacetPiece &one, int degree, const FacetPiece &other,
                                int other_degree, bool weighted,
                                const std::vector<LineRule> &rules) {
    constexpr double straight = 1e-12, most = 0.5;
    const auto total = [](const FacetPiece &of, int d) {
        return of.projected.count == 4 ? 2 * d : d;
    };
    const int own = total(one, degree);
    const int product = own + std::max(own, total(other, other_degree)) + (weighted ? own : 0);
    double points =
        0.5 * (product + 2); // one of the degrees is the map's of a square to a triangle
    const double off = std::max(bent(one.projected), bent(other.projected));
    if (off > straight)
        points += 6 / std::log10(1 / std::min(off, most)) - 0.5;
    std::size_t k = 0;
    while (k + 1 < rules.size() && rules[k].count < points)
        ++k;
    return rules[k];
}

// The plane of a piece, in two dimensions the line.
class PlaneOfPiece {
  public:
    PlaneOfPiece(const PieceInSpace &piece, bool in_plane) : origin_(piece.middle) {
        const Eigen::Vector3d &n = piece.normal;
        if (in_plane) {
            one_ = {n.y(), -n.x(), 0}, other_.setZero();
            return;
        }
        Eigen::Index least;
        n.cwiseAbs().minCoeff(&least);
        one_ = Eigen::Vector3d::Unit(least) - n[least] * n;
        one_.normalize();
        other_ = n.cross(one_);
    }
    Polygon<FacetPiece::MostCorners> projected(const PieceInSpace &piece) const {
        Polygon<FacetPiece::MostCorners> found;
        for (int k = 0; k < piece.count; ++k) {
            const Eigen::Vector3d arm = piece.x[std::size_t(k)] - origin_;
            found.add({arm.dot(one_), arm.dot(other_)});
        }
        return found;
    }

  private:
    Eigen::Vector3d origin_, one_, other_;
};

// Sums at slave nodes, facet by facet.
class MortarRows {
  public:
    using Entry = std::pair<std::int64_t, double>; // column and value

    std::vector<double> area, whole;      // int N_a over the covered part, and over all of it
    std::vector<std::vector<Entry>> rows; // int psi_a N_b

    MortarRows(std::size_t count, std::vector<LineRule> rules)
        : area(count), whole(count), rows(count), rules_(std::move(rules)) {}

    // Slave facets, and all those of the other side. Rows have several entries of one column.
    void add(const MortarSide &slave, const std::vector<MortarSide> &masters) {
        std::vector<std::vector<PieceInSpace>> opposite;
        opposite.reserve(masters.size());
        for (const auto &master : masters)
            opposite.push_back(master.pieces());
        std::vector<NearPieces> near(opposite.begin(), opposite.end());
        const auto pieces = slave.pieces();
        const auto shapes = slave.shapes();
        for (std::size_t facet = 0; facet < slave.facets; ++facet) {
            D_.setZero(slave.nodes), M_.setZero(slave.nodes, slave.nodes);
            met_.clear(), mixed_.clear();
            for (std::size_t part = 0; part < slave.parts; ++part) {
                const auto &piece = pieces[facet * slave.parts + part];
                const PlaneOfPiece plane(piece, slave.dim == 2);
                const FacetPiece here{plane.projected(piece), slave.on_reference(part)};
                add_whole(slave, facet, here, shapes);
                for (std::size_t s = 0; s < masters.size(); ++s)
                    near[s].each(piece, [&](std::size_t other) {
                        const std::size_t k = masters[s].parts;
                        const FacetPiece there{plane.projected(opposite[s][other]),
                                               masters[s].on_reference(other % k)};
                        integrate(slave, facet, here, shapes, masters[s], other / k, there);
                    });
            }
            add_facet(slave, facet);
        }
    }

  private:
    static constexpr int Most = FacetShapes::Most;
    using Matrix =
        Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, Most, Most>;
    struct Met {
        const MortarSide *side;
        std::size_t facet, first; // of its integrals
    };
    std::vector<LineRule> rules_;
    Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Most, 1> D_; // of the facet at hand
    Matrix M_;
    std::vector<Met> met_;      // facets that it meets,
    std::vector<double> mixed_; // and int N_a N_b with each

    static bool weighted(const MortarSide &slave) { return slave.density != nullptr; }
    static const double *density(const MortarSide &slave, std::size_t facet) {
        return slave.density != nullptr ? slave.density + facet * std::size_t(slave.nodes)
                                        : nullptr;
    }

    void add_whole(const MortarSide &slave, std::size_t facet, const FacetPiece &here,
                   const FacetShapes &shapes) {
        const auto &rule =
            rule_for(here, slave.degree, here, slave.degree, weighted(slave), rules_);
        on_common_part(here, here, rule, [&](Point p, double weight) {
            const auto N = shapes.at(here.reference(p));
            weight *= density_at(density(slave, facet), N, slave.nodes);
            for (int a = 0; a < slave.nodes; ++a)
                if (const auto row = slave.number(facet, a); row >= 0)
                    whole[std::size_t(row)] += weight * N[std::size_t(a)];
        });
    }

    void integrate(const MortarSide &slave, std::size_t facet, const FacetPiece &here,
                   const FacetShapes &shapes, const MortarSide &master, std::size_t other,
                   const FacetPiece &there) {
        if (apart(here.projected, there.projected))
            return;
        const std::size_t first = mixed_.size();
        const auto &rule =
            rule_for(here, slave.degree, there, master.degree, weighted(slave), rules_);
        mixed_.resize(first + std::size_t(slave.nodes * master.nodes), 0.0);
        if (add_common_integrals(here, shapes, there, master.shapes(), rule, density(slave, facet),
                                 D_.data(), M_.data(), &mixed_[first]))
            met_.push_back({&master, other, first});
        else
            mixed_.resize(first);
    }

    void add_facet(const MortarSide &slave, std::size_t facet) {
        if (met_.empty())
            return;
        constexpr double rounding = 1e-13; // of eigenvalues, over the largest
        const Eigen::SelfAdjointEigenSolver<Matrix> eigen(M_);
        const auto &values = eigen.eigenvalues();
        const double least = rounding * values.cwiseAbs().maxCoeff();
        const Matrix inverse = eigen.eigenvectors() *
                               (values.array().abs() > least)
                                   .select(values.cwiseInverse(), 0.0)
                                   .matrix()
                                   .asDiagonal() *
                               eigen.eigenvectors().transpose();
        const Matrix dual = D_.asDiagonal() * inverse;
        for (int a = 0; a < slave.nodes; ++a)
            if (const auto row = slave.number(facet, a); row >= 0)
                area[std::size_t(row)] += D_[a];
        for (const auto &met : met_) {
            const Eigen::Map<const Matrix> mixed(&mixed_[met.first], slave.nodes, met.side->nodes);
            const Matrix coefficients = dual * mixed;
            for (int a = 0; a < slave.nodes; ++a)
                if (const auto row = slave.number(facet, a); row >= 0)
                    for (int b = 0; b < met.side->nodes; ++b)
                        rows[std::size_t(row)].push_back(
                            {met.side->number(met.facet, b), coefficients(a, b)});
        }
    }
};
} // namespace dolfinx_contact
