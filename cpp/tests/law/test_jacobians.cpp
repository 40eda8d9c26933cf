// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// Derivatives of the maps and of the projection: differences on every branch, and at kinks.
#include "properties.h"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;

namespace {
/// A state as one vector (r, du_t, x_n), so that all derivatives are columns of one matrix.
template <int T> using Vector = Eigen::Matrix<double, 2 * (T + 1), 1>;
template <int T> using Derivative = Eigen::Matrix<double, T + 1, 2 * (T + 1)>;

template <int T> struct Result {
    Reaction<T> value;
    Derivative<T> derivative;
};

/// One of the maps at a state, by its derivative function.
template <class Law, int T = Law::tangents>
Result<T> linearised(int map, const Law &law, const Vector<T> &state, double rho) {
    const Local<T> r = state.template head<T + 1>();
    const Tangent<T> slip = state.template segment<T>(T + 1);
    const double gap = state[2 * T + 1];
    Linearisation<T> out;
    if (map == 0) {
        out.value = project(law, r, &out.by_reaction);
        out.by_motion.setZero();
    } else if (map == 1)
        out = bipotential_jacobian(law, r, gap, slip, rho);
    else if (map == 2)
        out = scaled_jacobian(law, r, gap, slip, rho);
    else
        out = return_jacobian(law, r, gap, slip, rho, 0.5 * rho);
    Derivative<T> all;
    all << out.by_reaction, out.by_motion;
    return {out.value, all};
}

/// The same map by the function without derivatives.
template <class Law, int T = Law::tangents>
Reaction<T> value(int map, const Law &law, const Vector<T> &state, double rho) {
    const Local<T> r = state.template head<T + 1>();
    const Tangent<T> slip = state.template segment<T>(T + 1);
    const double gap = state[2 * T + 1];
    if (map == 0)
        return project(law, r);
    if (map == 1)
        return bipotential_map(law, r, gap, slip, rho);
    if (map == 2)
        return scaled_map(law, r, gap, slip, rho);
    return return_map(law, r, gap, slip, rho, 0.5 * rho);
}

template <class Law, int T = Law::tangents> Vector<T> random_state(const Law &law, Random &random) {
    Vector<T> state;
    state << random.point(law), random.tangent<T>(), random.normal();
    return state;
}

template <class Law> class Jacobians : public ::testing::Test {
  public:
    static Law law(Random &random) {
        const auto mu = [&] { return random.uniform(0.1, 2.0); };
        if constexpr (std::is_same_v<Law, Frictionless>)
            return {};
        else if constexpr (is_isotropic<Law>)
            return {mu()};
        else if constexpr (std::is_same_v<Law, Associated<2>>)
            return {{mu(), mu()}};
        else
            return {{mu(), mu()}, {1.0, random.uniform(0.1, 1.0)}};
    }
};
using Laws = ::testing::Types<Isotropic<1>, Isotropic<2>, Associated<2>, NonAssociated<2>>;
} // namespace
TYPED_TEST_SUITE(Jacobians, Laws);

// Central differences of every map agree with its derivative, wherever the branch is the same at
// all points of the stencil: thousands of states, at least hundreds on each branch.
TYPED_TEST(Jacobians, are_the_limits_of_differences) {
    constexpr int T = TypeParam::tangents, N = 2 * (T + 1);
    constexpr double h = 1e-5;
    Random random(1);
    for (int map = 0; map < 4; ++map) {
        std::array<int, 3> checked{};
        for (int draw = 0; draw < 20000; ++draw) {
            const auto law = this->law(random);
            const Vector<T> state = random_state(law, random);
            const double rho = random.uniform(0.2, 2.0);
            const Result<T> at = linearised(map, law, state, rho);
            EXPECT_EQ(at.value.r, value(map, law, state, rho).r);
            const double slip = length(state.template segment<T>(T + 1));
            const bool near_apex = at.value.branch == Branch::slip && at.value.r[T] < 0.1;
            if ((map == 1 || map == 2) && slip < 0.2)
                continue; // the kink of |du_t|, below
            Derivative<T> differences;
            bool smooth = !near_apex;
            for (int i = 0; i < N && smooth; ++i) {
                const Vector<T> step = h * Vector<T>::Unit(i);
                const Reaction<T> plus = value<TypeParam>(map, law, state + step, rho),
                                  minus = value<TypeParam>(map, law, state - step, rho);
                smooth = plus.branch == at.value.branch && minus.branch == at.value.branch;
                differences.col(i) = (plus.r - minus.r) / (2.0 * h);
            }
            if (!smooth)
                continue;
            ++checked[static_cast<std::size_t>(at.value.branch)];
            ASSERT_LT((differences - at.derivative).cwiseAbs().maxCoeff(), 1e-6)
                << "map " << map << " branch " << int(at.value.branch) << "\n"
                << differences << "\n\n"
                << at.derivative;
        }
        for (const int count : checked)
            EXPECT_GT(count, 500) << "map " << map;
    }
}

// At a kink (apex, boundary of the cone or its polar, no slip) the derivative is that of a
// differentiable state next to it: an element of Clarke's generalised Jacobian.
TYPED_TEST(Jacobians, at_kinks_are_limits_of_nearby_ones) {
    constexpr int T = TypeParam::tangents;
    Random random(2);
    int kinks = 0;
    for (int draw = 0; draw < 3000; ++draw) {
        const auto law = this->law(random);
        const double rho = random.uniform(0.2, 2.0);
        Vector<T> state = Vector<T>::Zero();
        const int map = random.below(5), kind = random.below(4);
        Tangent<T> t;
        for (int i = 0; i < T; ++i)
            t[i] = random.normal();
        if (kind != 3) { // 3: everything zero
            state.template head<T>() = t;
            Local<T> r = state.template head<T + 1>();
            Tangent<T> dual;
            for (int i = 0; i < T; ++i)
                dual[i] = law.mu(i) * t[i];
            state[T] =
                kind == 0 ? -length(dual) : load_function(law, r); // 0: boundary of the polar
            if (kind == 2)                                         // inside, no slip
                state[T] *= 2.0;
        }
        // r of a map is in the cone
        if (map != 0 && kind == 0)
            continue;
        ++kinks;
        const Derivative<T> at = linearised(map, law, state, rho).derivative;
        double nearest = 1e300;
        for (int trial = 0; trial < 400; ++trial) {
            Vector<T> direction;
            for (int i = 0; i < direction.size(); ++i)
                direction[i] = random.normal();
            // the least slip against the force, or along the first axis, beside other changes
            Tangent<T> w = Tangent<T>::Unit(0);
            for (int i = 0; i < T && kind != 3; ++i)
                w[i] = -state[i] / law.mu(i);
            for (int i = 0; i < T; ++i)
                direction[T + 1 + i] = 1e-4 * w[i] / (law.mu(i) * law.q2(i));
            const Derivative<T> near =
                linearised<TypeParam>(map, law, state + 1e-8 * direction, rho).derivative;
            nearest = std::min(nearest, (near - at).cwiseAbs().maxCoeff());
        }
        ASSERT_LT(nearest, 1e-6) << "map " << map << " kind " << kind;
    }
    EXPECT_GT(kinks, 2000);
}

// The derivative of a Euclidean projection is symmetric with eigenvalues between 0 and 1, at any
// ratio of coefficients and any magnitude, and does not change with the magnitude.
TYPED_TEST(Jacobians, of_the_projection_is_symmetric_and_non_expansive) {
    constexpr int T = TypeParam::tangents;
    Random random(3);
    for (int draw = 0; draw < 20000; ++draw) {
        TypeParam law = this->law(random);
        if constexpr (is_isotropic<TypeParam>)
            law.coefficient = random.coefficients<1>()[0];
        else
            law.coefficient = random.coefficients<2>();
        const Local<T> tau = random.point(law);
        Jacobian<T> J, scaled;
        project(law, tau, &J);
        project(law, Local<T>(std::ldexp(1.0, 400) * tau), &scaled);
        EXPECT_EQ(J, scaled);
        EXPECT_LE((J - J.transpose()).cwiseAbs().maxCoeff(), 4 * epsilon);
        const Eigen::SelfAdjointEigenSolver<Jacobian<T>> eigen(J);
        EXPECT_GE(eigen.eigenvalues()[0], -16 * epsilon);
        EXPECT_LE(eigen.eigenvalues()[T], 1.0 + 16 * epsilon);
        // homogeneous of degree one
        EXPECT_LE(length(J * tau - project(law, tau).r), 32 * epsilon * length(tau));
    }
}

// Without friction only the normal component has a derivative: 1 if pressed, 0 if open.
TEST(Frictionless, derivative_is_that_of_the_positive_part) {
    for (const double n : {-1.0, 0.0, 2.0}) {
        Jacobian<0> J;
        const Reaction<0> at = project(Frictionless{}, Local<0>(n), &J);
        EXPECT_EQ(at.r[0], std::max(n, 0.0));
        EXPECT_EQ(J(0, 0), n > 0.0 ? 1.0 : 0.0);
        EXPECT_EQ(at.branch, n > 0.0 ? Branch::slip : Branch::open);
        const Tangent<0> none;
        for (const auto &out : {bipotential_jacobian(Frictionless{}, Local<0>(n), 0.0, none, 3.0),
                                scaled_jacobian(Frictionless{}, Local<0>(n), 0.0, none, 3.0),
                                return_jacobian(Frictionless{}, Local<0>(n), 0.0, none, 3.0, 1.0)})
            EXPECT_EQ(out.by_motion(0, 0), n > 0.0 ? -3.0 : 0.0);
    }
}
