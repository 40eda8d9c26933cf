// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// The smoothed map: its equation, its distance from the return map, its fixed points and its
/// derivative, at random states of any magnitude.
#include "properties.h"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>
#include <iostream>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;

namespace {
int most_rounded_steps = 0; // Newton steps

/// The smoothed map where nothing moves, with rho_t = 1.
template <class Law, int T = Law::tangents>
Local<T> smoothed(const Law &law, const Local<T> &r, double rounding, Jacobian<T> *J = nullptr) {
    const Tangent<T> still = Tangent<T>::Zero();
    return smoothed_map(law, r, 0.0, still, 1.0, 1.0, rounding, J).r;
}

/// Solved, inside the cone, non-expansive in the metric of the slip rule, and no farther there
/// from the return map than it can be.
template <class Law, int T = Law::tangents>
std::string map_properties(const Law &law, const Local<T> &a, const Local<T> &b, double rounding) {
    const Tangent<T> still = Tangent<T>::Zero(), a_t = a.template head<T>();
    Local<T> other = b;
    other[T] = a[T];
    const Tangent<T> b_t = other.template head<T>();
    const Local<T> x = smoothed(law, a, rounding);
    const Reaction<T> exact = return_map(law, a, 0.0, still, 1.0, 1.0);
    const Tangent<T> change = (x - smoothed(law, other, rounding)).template head<T>(),
                     from_exact = (x - exact.r).template head<T>();
    const double size = slip_length(law, a_t) + slip_length(law, b_t), R = exact.r[T];
    std::string wrong = x.allFinite() ? "" : "not finite; ";
    wrong += at_most(slip_length(law, change), slip_length(law, a_t - b_t) + 8 * epsilon * size,
                     "own metric");
    if (x[T] != R || smoothed_map(law, a, 0.0, still, 1.0, 1.0, rounding).branch != exact.branch)
        wrong += "not the normal part of return_map; ";
    wrong += at_most(slip_length(law, from_exact),
                     std::sqrt(rounding / inverse_p_squared(law).minCoeff()) * std::sqrt(R) +
                         8 * epsilon * size,
                     "distance from the return map");
    wrong += at_most(load_function(law, x), 8 * epsilon * R, "load function");
    if (R == 0.0)
        return wrong;

    const RoundedEquation<T> equation = smoothed_equation(law, a, rounding);
    int steps = 0;
    const SecularRoot<T> root = solve(equation, &steps);
    most_rounded_steps = std::max(most_rounded_steps, steps);
    const double slack = equation.k / root.s;
    if (slack > 16 * epsilon && !(load_function(law, x) < 0.0))
        wrong += "not inside the cone; ";
    return wrong + at_most(std::abs(norm<T>(root.e) - 1.0 + slack), 16 * epsilon, "equation");
}

/// The tangential part of the derivative is symmetric in the metric of the slip rule with
/// eigenvalues between 0 and 1, it is finite, and does not change with the magnitude.
template <class Law, int T = Law::tangents>
std::string derivative_properties(const Law &law, const Local<T> &r, double rounding) {
    Jacobian<T> J, scaled;
    const double two = std::ldexp(1.0, r.template lpNorm<Eigen::Infinity>() < 1.0 ? 300 : -300);
    const Local<T> x = smoothed(law, r, rounding, &J),
                   y = smoothed(law, Local<T>(two * r), two * rounding, &scaled);
    std::string wrong = J.allFinite() ? "" : "derivative not finite; ";
    if (y != two * x || scaled != J)
        wrong += "not homogeneous in powers of two; ";
    const Tangent<T> inverse = inverse_p_squared(law);
    Eigen::Matrix<double, T, T> B;
    for (int i = 0; i < T; ++i)
        for (int j = 0; j < T; ++j)
            B(i, j) = J(i, j) * (law.mu(j) / law.mu(i)) * std::sqrt(inverse[j] / inverse[i]);
    wrong += at_most((B - B.transpose()).cwiseAbs().maxCoeff(), 16 * epsilon, "symmetry");
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, T, T>> eigen(B);
    return wrong + at_most(-eigen.eigenvalues()[0], 16 * epsilon, "least eigenvalue") +
           at_most(eigen.eigenvalues()[T - 1], 1.0 + 16 * epsilon, "largest eigenvalue");
}

/// du_i = -s r_i / q_i with s (r_n - |M^-1 r_t|) = rounding is left alone, whatever the metric.
template <class Law, int T = Law::tangents>
std::string fixed_points(const Law &law, double rounding, Random &random) {
    const double R = random.power(-3, 3), slack = random.power(-3, 0);
    const Tangent<T> e = random.tangent<T>(), inverse = inverse_p_squared(law);
    Local<T> r = Local<T>::Zero();
    r[T] = R;
    for (int i = 0; i < T && length(e) > 0.0; ++i)
        r[i] = law.mu(i) * R * (1.0 - slack) * (e[i] / length(e));
    const double s = rounding / -load_function(law, r);
    Tangent<T> slip, r_t = r.template head<T>();
    for (int i = 0; i < T; ++i)
        slip[i] = -s * r[i] * (inverse[i] / inverse.minCoeff());
    const double rho_t = random.power(-3, 3);
    const Reaction<T> moved = smoothed_map(law, r, 0.0, slip, random.power(-3, 3), rho_t, rounding);
    const Tangent<T> change = moved.r.template head<T>() - r_t;
    // the slack, of which s is made, has a rounding error of R
    return at_most(slip_length(law, change),
                   16 * epsilon / slack * (slip_length(law, r_t) + rho_t * slip_length(law, slip)),
                   "moves a fixed point") +
           at_most(std::abs(moved.r[T] - R), 0.0, "changes R");
}

template <class Law> std::string smoothed_properties(const Law &law, Random &random) {
    constexpr int T = Law::tangents;
    const double scale = random.below(4) == 0 ? random.power(-150, 150) : 1.0;
    const double rounding = random.power(-20, 3);
    const Local<T> a = scale * random.point(law), other = scale * random.point(law);
    const bool near = random.below(2) == 0;
    const Local<T> b = near ? Local<T>(a + random.power(-17, -1) * other) : other;
    return map_properties(law, a, b, scale * rounding) +
           derivative_properties(law, a, scale * rounding) + fixed_points(law, rounding, random);
}

std::string properties_of_any_law(Random &random) {
    const int kind = random.below(5);
    if (kind == 0)
        return smoothed_properties(Isotropic<1>{random.coefficients<1>()[0]}, random);
    if (kind == 1)
        return smoothed_properties(Isotropic<2>{random.coefficients<1>()[0]}, random);
    const Tangent<2> mu = random.coefficients<2>();
    if (kind == 2)
        return smoothed_properties(Associated<2>{mu}, random);
    const Tangent<2> q = normalised_q<2>(mu, random.coefficients<2>());
    return smoothed_properties(NonAssociated<2>{mu, q.cwiseAbs2()}, random);
}
} // namespace

// The properties above hold at random states, inside, outside, on the boundary, on the axes, at the
// apex, at any magnitude, ratio of coefficients and rounding, after few Newton steps.
TEST(SmoothedMap, properties_at_random_states) {
    Random random(1);
    int wrong = 0;
    for (int draw = 0; draw < 100000; ++draw) {
        const std::string what = properties_of_any_law(random);
        if (!what.empty() && ++wrong <= 10)
            ADD_FAILURE() << "draw " << draw << ": " << what;
    }
    EXPECT_EQ(wrong, 0);
    std::cout << "most Newton steps at a random state: " << most_rounded_steps << "\n";
    EXPECT_LE(most_rounded_steps, 20);
}

// Newton's method ends before its bound: in the slowest case of secular.h, with any k.
TEST(SmoothedMap, newton_steps_in_the_slowest_case) {
    Random random(2);
    int most = 0;
    for (int draw = 0; draw < 100000; ++draw) {
        const double a = random.power(-3, 0), c = a * (1.0 + random.power(-17, -1));
        const RoundedEquation<2> equation{
            {a, random.power(-3, 3)}, {random.power(-100, 0), 1.0}, c, random.power(-100, 1)};
        int steps = 0;
        solve(equation, &steps);
        most = std::max(most, steps);
    }
    std::cout << "most Newton steps: " << most << "\n";
    EXPECT_LT(most, RoundedEquation<2>::max_steps);
}

// rounding = 0 is the return map with its derivative, to the last digit.
TEST(SmoothedMap, without_rounding_is_the_return_map) {
    Random random(3);
    const NonAssociated<2> law{{0.3, 0.15}, {0.05, 1.0}};
    for (int draw = 0; draw < 1000; ++draw) {
        const Local<2> r = random.point(law);
        const Tangent<2> slip = random.tangent<2>();
        const auto at = smoothed_jacobian(law, r, 0.1, slip, 2.0, 3.0, 0.0),
                   expected = return_jacobian(law, r, 0.1, slip, 2.0, 3.0);
        EXPECT_EQ(at.value.r, expected.value.r);
        EXPECT_EQ(at.value.branch, expected.value.branch);
        EXPECT_EQ(at.by_reaction, expected.by_reaction);
        EXPECT_EQ(at.by_motion, expected.by_motion);
    }
}
