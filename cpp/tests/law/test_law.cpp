// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// make_law: the simplest kind for given coefficients, their normalisation and their limits.
#include "properties.h"
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;

namespace {
using Pair = Tangent<2>;
using Pairs = std::vector<Pair>;

template <class Source> bool is(const AnyLaw<2> &law) {
    return std::holds_alternative<Source>(law);
}
} // namespace

// A law is of no more general kind than its coefficients ask for.
TEST(MakeLaw, chooses_the_simplest_kind) {
    const Pair none(0, 0), equal(0.2, 0.2), mu(0.3, 0.15), p(0.05, 0.2);
    EXPECT_TRUE(is<Uniform<Frictionless>>(make_law<2>({none}, {none}, true)));
    EXPECT_TRUE(is<Uniform<Frictionless>>(make_law<2>({none, none}, {p, p}, false)));
    EXPECT_TRUE(is<Uniform<Isotropic<2>>>(make_law<2>({equal}, {equal}, true)));
    EXPECT_TRUE(is<Uniform<Associated<2>>>(make_law<2>({mu}, {mu}, true)));
    EXPECT_TRUE(is<Uniform<NonAssociated<2>>>(make_law<2>({mu}, {p}, true)));
    EXPECT_TRUE(is<Uniform<NonAssociated<2>>>(make_law<2>({equal}, {p}, true)));
    EXPECT_TRUE(is<Field<Isotropic<2>>>(make_law<2>({equal, none}, {equal, none}, false)));
    EXPECT_TRUE(is<Field<Associated<2>>>(make_law<2>({equal, mu}, {equal, mu}, false)));
    EXPECT_TRUE(is<Field<NonAssociated<2>>>(make_law<2>({equal, mu}, {equal, p}, false)));
}

// Scaling p by any power of ten changes Q by rounding at most, and p = c mu is the associated rule.
TEST(MakeLaw, is_independent_of_the_scale_of_p) {
    Random random(1);
    for (int draw = 0; draw < 2000; ++draw) {
        const Pair mu = random.coefficients<2>(), p = random.coefficients<2>();
        const Pair q = normalised_q<2>(mu, p);
        EXPECT_EQ(q.maxCoeff(), 1.0);
        for (const double scale : {1e-9, 1e-3, 1e3, 1e9}) {
            const Pair scaled = normalised_q<2>(mu, scale * p);
            EXPECT_LE((scaled - q).cwiseAbs().maxCoeff(), 4 * epsilon);
            EXPECT_FALSE(is<Uniform<NonAssociated<2>>>(make_law<2>({mu}, {scale * mu}, true)));
        }
    }
}

// Coefficients that are negative, not finite, out of range or zero in one direction are refused.
TEST(MakeLaw, refuses_coefficients_out_of_range) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    constexpr double inf = std::numeric_limits<double>::infinity();
    const Pair good(0.3, 0.2);
    for (const double bad : {-0.1, nan, inf, 0.0, 1e-60, 1e60})
        EXPECT_THROW(make_law<2>({Pair(0.3, bad)}, {good}, true), std::invalid_argument) << bad;
    for (const double bad : {-0.1, nan, inf, 0.0, 1e-60})
        EXPECT_THROW(make_law<2>({good}, {Pair(0.3, bad)}, true), std::invalid_argument) << bad;
}

// A node of a field with mu = 0 behaves as under a frictionless law, to the last digit.
TEST(MakeLaw, frictionless_nodes_of_a_field) {
    Random random(2);
    const auto any = make_law<2>({Pair(0, 0), Pair(0.3, 0.1)}, {Pair(0, 0), Pair(1, 1)}, false);
    const NonAssociated<2> law = std::get<Field<NonAssociated<2>>>(any)(0);
    for (int draw = 0; draw < 1000; ++draw) {
        const Local<2> tau = random.point(Isotropic<2>{0.5});
        const double gap = random.normal();
        const Pair slip = random.tangent<2>();
        const auto expect = [](const Reaction<2> &r, const Reaction<0> &expected) {
            EXPECT_EQ(r.r, Local<2>(0.0, 0.0, expected.r[0]));
            EXPECT_EQ(r.branch, expected.branch);
        };
        const Local<0> n(tau[2]);
        Local<2> r(0.0, 0.0, std::max(tau[2], 0.0));
        expect(project(law, tau), project(Frictionless{}, n));
        const Local<0> rn(r[2]);
        const Tangent<0> none;
        expect(bipotential_map(law, r, gap, slip, 2.0),
               bipotential_map(Frictionless{}, rn, gap, none, 2.0));
        expect(scaled_map(law, r, gap, slip, 2.0), scaled_map(Frictionless{}, rn, gap, none, 2.0));
        expect(return_map(law, r, gap, slip, 2.0, 1.0),
               return_map(Frictionless{}, rn, gap, none, 2.0, 1.0));
        EXPECT_EQ(bipotential_gap(law, r, std::abs(gap), slip), r[2] * std::abs(gap));
        EXPECT_EQ(slip_defect(law, r, slip, Branch::slip), Tangent<2>::Zero());
    }
}

// Infinite and NaN points are not projected to anything finite; finite ones never give NaN.
TEST(Projection, of_what_is_not_finite) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    constexpr double inf = std::numeric_limits<double>::infinity();
    const Associated<2> law{{0.3, 0.1}};
    for (const double bad : {nan, inf, -inf})
        for (int i = 0; i < 3; ++i) {
            Local<2> tau(0.1, -0.2, i == 0 ? -3.0 : 3.0);
            tau[i] = bad;
            EXPECT_TRUE(project(law, tau).r.array().isNaN().all());
            EXPECT_TRUE(project(Isotropic<2>{0.2}, tau).r.array().isNaN().all());
        }
    EXPECT_TRUE(std::isnan(project(Frictionless{}, Local<0>(nan)).r[0]));
}
