// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// Loops over nodes: the same as node by node for every law, layout and number of nodes.
#include "properties.h"
#include <gtest/gtest.h>
#include <numeric>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;

namespace {
/// Arrays of n nodes in three dimensions, component j of node i at (i * row + j * column).
struct Arrays {
    std::ptrdiff_t row, column;
    std::vector<double> data;
    Arrays(int n, int components, bool by_component, double fill = 0.0)
        : row(by_component ? 1 : components + 1), column(by_component ? n + 3 : 1),
          data(static_cast<std::size_t>((n + 3) * (components + 1)), fill) {}
    double &operator()(int i, int j = 0) {
        return data[static_cast<std::size_t>(i * row + j * column)];
    }
    View<const double> in() const { return {data.data(), row, column}; }
    View<double> out() { return {data.data(), row, column}; }
};

struct Contact {
    int n;
    Arrays r, gap, slip, rho, axes;
    Contact(int n, bool by_component, std::uint64_t seed)
        : n(n), r(n, 3, by_component), gap(n, 1, by_component), slip(n, 2, by_component),
          rho(n, 1, by_component), axes(n, 2, by_component) {
        Random random(seed);
        const Associated<2> law{{0.3, 0.15}};
        for (int i = 0; i < n; ++i) {
            const Local<2> point = random.point(law);
            const Tangent<2> s = random.tangent<2>();
            const double angle = random.uniform(0.0, 7.0);
            for (int j = 0; j < 3; ++j)
                r(i, j) = point[j];
            for (int j = 0; j < 2; ++j)
                slip(i, j) = s[j];
            gap(i) = random.normal();
            rho(i) = random.power(-1, 1);
            axes(i, 0) = std::cos(angle);
            axes(i, 1) = std::sin(angle);
        }
    }
    Inputs inputs(bool rotated) const {
        Inputs in;
        in.r = r.in();
        in.gap = gap.in();
        in.slip = slip.in();
        in.rho_n = in.rho_t = rho.in();
        if (rotated)
            in.axes = axes.in();
        return in;
    }
};

/// Each map by its function of one node.
template <class Law, class S> auto at_node(EuclideanProjection, const Law &law, const S &s) {
    return project(law, s.r);
}
template <class Law, class S> auto at_node(BipotentialMap, const Law &law, const S &s) {
    return bipotential_map(law, s.r, s.gap, s.slip, s.rho_n);
}
template <class Law, class S> auto at_node(ScaledMap, const Law &law, const S &s) {
    return scaled_map(law, s.r, s.gap, s.slip, s.rho_n);
}
template <class Law, class S> auto at_node(ReturnMap, const Law &law, const S &s) {
    return return_map(law, s.r, s.gap, s.slip, s.rho_n, s.rho_t);
}

/// Nodal result by the function of one node, in the frame of the arrays.
template <class Law, class F>
Reaction<2> expected(const Law &law, F f, Contact &c, int i, bool rotated) {
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    if (rotated)
        turn.topLeftCorner<2, 2>() << c.axes(i, 0), c.axes(i, 1), -c.axes(i, 1), c.axes(i, 0);
    State<2> s{turn * Local<2>(c.r(i, 0), c.r(i, 1), c.r(i, 2)),
               c.gap(i),
               turn.topLeftCorner<2, 2>() * Tangent<2>(c.slip(i, 0), c.slip(i, 1)),
               c.rho(i),
               c.rho(i),
               Branch::open};
    Reaction<2> result = at_node(f, law, s);
    result.r = turn.transpose() * result.r;
    return result;
}

template <class Source, class F> void check(const Source &source, F f) {
    for (const int n : {0, 1, 63, 64, 65, 200})
        for (const bool by_component : {false, true})
            for (const bool rotated : {false, true}) {
                Contact c(n, by_component, 5);
                Arrays value(n, 3, by_component, 7.0);
                std::vector<std::uint8_t> branch(static_cast<std::size_t>(n) + 1, 9);
                Outputs out;
                out.value = value.out();
                out.branch = {branch.data(), 1, 0};
                for_each_node(source, static_cast<std::size_t>(n), c.inputs(rotated), out, f);
                for (int i = 0; i < n; ++i) {
                    const auto node = static_cast<std::size_t>(i);
                    const Reaction<2> want = expected(source(node), f, c, i, rotated);
                    const Local<2> got(value(i, 0), value(i, 1), value(i, 2));
                    // results at a kink may differ by rounding: status too, but not the reaction
                    EXPECT_LE((got - want.r).norm(), 16 * epsilon * (1.0 + want.r.norm()));
                    if (!rotated) {
                        EXPECT_EQ(branch[node], static_cast<std::uint8_t>(want.branch));
                    }
                }
                EXPECT_EQ(branch.back(), 9) << "written past the end";
                EXPECT_EQ(value(n, 0), 7.0) << "written past the end";
            }
}
} // namespace

// Every map over nodes gives what it gives node by node, in any layout, with principal axes turned
// at each node, for numbers of nodes around the block size, and writes nothing beyond them.
TEST(Batch, equals_node_by_node) {
    Random random(6);
    Field<NonAssociated<2>> field;
    for (int i = 0; i < 200; ++i)
        field.laws.push_back({{random.uniform(0.1, 1), random.uniform(0.1, 1)}, {1.0, 0.3}});
    const auto check_all = [](const auto &source) {
        check(source, EuclideanProjection{});
        check(source, BipotentialMap{});
        check(source, ReturnMap{});
        check(source, ScaledMap{});
    };
    check_all(Uniform<Isotropic<2>>{{0.4}});
    check_all(Uniform<Associated<2>>{{{0.3, 0.15}}});
    check_all(Uniform<NonAssociated<2>>{{{0.3, 0.15}, {0.05, 1.0}}});
    check_all(field);
}

// A frictionless law reads and writes the normal components alone: tangential inputs may be NaN and
// tangential outputs keep what they held.
TEST(Batch, frictionless_touches_no_tangential_memory) {
    Contact c(100, false, 7);
    Arrays value(100, 3, false, 7.0);
    for (int i = 0; i < 100; ++i)
        c.r(i, 0) = c.r(i, 1) = c.slip(i, 0) = c.slip(i, 1) =
            std::numeric_limits<double>::quiet_NaN();
    const auto check_map = [&](auto map) {
        Outputs out;
        out.value = value.out();
        for_each_node(Uniform<Frictionless>{}, 100, c.inputs(true), out, map);
        for (int i = 0; i < 100; ++i) {
            EXPECT_EQ(value(i, 0), 7.0);
            EXPECT_EQ(value(i, 1), 7.0);
            EXPECT_EQ(value(i, 2), std::max(c.r(i, 2) - c.rho(i) * c.gap(i), 0.0));
        }
    };
    check_map(BipotentialMap{});
    check_map(ScaledMap{});
    check_map(ReturnMap{});
}

// Results may overwrite inputs.
TEST(Batch, in_place) {
    Contact c(150, false, 8), copy = c;
    Outputs out;
    out.value = c.r.out();
    const Uniform<Associated<2>> source{{{0.3, 0.15}}};
    for_each_node(source, 150, c.inputs(false), out, BipotentialMap{});
    for (int i = 0; i < 150; ++i) {
        const Local<2> want = expected(source.law, BipotentialMap{}, copy, i, false).r;
        EXPECT_LE((Local<2>(c.r(i, 0), c.r(i, 1), c.r(i, 2)) - want).norm(),
                  16 * epsilon * (1.0 + want.norm()));
    }
}

// Derivatives with turned principal axes are those of the map in the turned frame.
TEST(Batch, derivatives_turn_with_the_axes) {
    Contact c(80, true, 9);
    Arrays by_reaction(80, 9, true), by_motion(80, 9, true);
    const Uniform<NonAssociated<2>> source{{{0.3, 0.15}, {0.05, 1.0}}};
    Outputs out;
    out.by_reaction = by_reaction.out();
    out.by_motion = by_motion.out();
    for_each_node(source, 80, c.inputs(true), out, BipotentialJacobian{});
    for (int i = 0; i < 80; ++i) {
        Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
        turn.topLeftCorner<2, 2>() << c.axes(i, 0), c.axes(i, 1), -c.axes(i, 1), c.axes(i, 0);
        const Local<2> r = turn * Local<2>(c.r(i, 0), c.r(i, 1), c.r(i, 2));
        const Tangent<2> slip = turn.topLeftCorner<2, 2>() * Tangent<2>(c.slip(i, 0), c.slip(i, 1));
        const auto want = bipotential_jacobian(source.law, r, c.gap(i), slip, c.rho(i));
        const Eigen::Matrix3d J_r = turn.transpose() * want.by_reaction * turn,
                              J_w = turn.transpose() * want.by_motion * turn;
        for (int k = 0; k < 9; ++k) {
            EXPECT_NEAR(by_reaction(i, k), J_r(k / 3, k % 3), 1e-14);
            EXPECT_NEAR(by_motion(i, k), J_w(k / 3, k % 3), 1e-14 * (1.0 + c.rho(i)));
        }
    }
}
