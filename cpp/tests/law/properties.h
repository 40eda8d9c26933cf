// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// What every projection and map has to satisfy, as checks of one random state. Each gives a string
/// that is empty where the property holds.
#pragma once

#include "../random_states.h"
#include <sstream>
#include <string>

namespace dolfinx_contact::testing {
/// "" if value <= bound (false for NaN too), else what was found.
inline std::string at_most(double value, double bound, const char *what) {
    if (value <= bound)
        return "";
    std::ostringstream message;
    message.precision(17);
    message << what << ": " << value << " > " << bound << "; ";
    return message.str();
}

template <class Law> double largest_mu(const Law &law) {
    double mu = 0.0;
    for (int i = 0; i < Law::tangents; ++i)
        mu = std::max(mu, law.mu(i));
    return mu;
}

/// Overflow-free norm of a vector of any magnitude.
template <class V> double length(const V &v) { return v.stableNorm(); }

/// The Euclidean projection: admissible, Moreau's decomposition tau = r + z with z in the polar
/// cone and orthogonal to r, idempotent, homogeneous, equivariant under reflection.
template <class Law, int T = Law::tangents>
std::string projection_properties(const Law &law, const Local<T> &tau, Random &random) {
    const Local<T> r = project(law, tau).r, z = tau - r;
    const double size = length(tau), mu = largest_mu(law), tolerance = 8 * epsilon * size;
    std::string wrong = r.allFinite() ? "" : "not finite; ";
    wrong += at_most(load_function(law, r), 8 * epsilon * r[T], "load function");
    Local<T> dual = z;
    for (int i = 0; i < T; ++i)
        dual[i] *= law.mu(i);
    wrong += at_most(length(dual.template head<T>()) + z[T], tolerance * (1.0 + mu), "polar cone");
    if (size > 0.0)
        wrong += at_most(std::abs((r / size).dot(z / size)), 8 * epsilon, "orthogonality");
    wrong += at_most(length(project(law, r).r - r), tolerance, "idempotence");

    const double two = std::ldexp(1.0, random.below(41) - 20), ten = random.power(-9, 9);
    if (project(law, Local<T>(two * tau)).r != two * r)
        wrong += "not homogeneous in powers of two; ";
    wrong += at_most(length(project(law, Local<T>(ten * tau)).r - ten * r), ten * tolerance,
                     "homogeneity");
    Local<T> mirror = Local<T>::Ones();
    mirror[random.below(T)] = -1.0;
    if (project(law, Local<T>(mirror.cwiseProduct(tau))).r != mirror.cwiseProduct(r))
        wrong += "not equivariant under reflection; ";
    return wrong;
}

/// The scaled map where nothing moves is the projection on the cone |x| <= n of the scaled
/// variables x = M^-1 r_t: it is repeated without effect, decomposes after Moreau, and is
/// non-expansive.
template <class Law, int T = Law::tangents>
std::string scaled_map_properties(const Law &law, const Local<T> &a, const Local<T> &b) {
    const Tangent<T> still = Tangent<T>::Zero();
    const auto scaled = [&law](Local<T> r) {
        for (int i = 0; i < T; ++i)
            r[i] /= law.mu(i);
        return r;
    };
    const auto mapped = [&](const Local<T> &r) { return scaled_map(law, r, 0.0, still, 1.0).r; };
    const Local<T> x = scaled(a), at = mapped(a), y = scaled(at), z = x - y,
                   change = y - scaled(mapped(b));
    const Tangent<T> z_t = z.template head<T>();
    const double size = length(x), tolerance = 8 * epsilon * size;
    std::string wrong = at_most(load_function(law, at), 8 * epsilon * at[T], "scaled load");
    wrong += at_most(length(z_t) + z[T], tolerance, "scaled polar cone");
    if (size > 0.0)
        wrong += at_most(std::abs((y / size).dot(z / size)), 8 * epsilon, "scaled orthogonality");
    wrong += at_most(length(scaled(mapped(at)) - y), tolerance, "scaled map repeated");
    return wrong + at_most(length(change),
                           length(x - scaled(b)) + tolerance + 8 * epsilon * length(scaled(b)),
                           "scaled metric");
}

/// Newton steps of the equations of both projections, whichever takes more.
template <class Law, int T = Law::tangents> int newton_steps(const Law &law, const Local<T> &tau) {
    const Local<T> p = tau * power_of_two(largest<T + 1>(tau)).down;
    int most = 0;
    if (project(law, tau).branch == Branch::slip)
        most = solve<T>(boundary_equation(law, p)).steps;
    const Tangent<T> still = Tangent<T>::Zero(), z = in_units_of_ellipse(law, tau);
    if (return_map(law, tau, 0.0, still, 1.0, 1.0).branch == Branch::slip)
        most = std::max(most, solve<T>(return_equation(law, z, tau[T])).steps);
    return most;
}

/// |P(a) - P(b)| <= |a - b|: non-expansive, hence continuous across the branches.
template <class Law, int T = Law::tangents>
std::string non_expansive(const Law &law, const Local<T> &a, const Local<T> &b) {
    const Local<T> change = project(law, a).r - project(law, b).r;
    return at_most(length(change), length(a - b) + 8 * epsilon * (length(a) + length(b)),
                   "non-expansive");
}

/// Length in the metric of the slip rule: of M^-1 t with weights p_i, the smallest of them 1.
template <class Law, class Vector> double slip_length(const Law &law, const Vector &t) {
    constexpr int T = Law::tangents;
    const Tangent<T> inverse = inverse_p_squared(law);
    Tangent<T> weighted;
    for (int i = 0; i < T; ++i)
        weighted[i] = t[i] / law.mu(i) / std::sqrt(inverse[i]);
    return length(weighted);
}

/// The return map at R fixed is non-expansive in its own metric, that of the slip rule; repeated
/// where nothing moves it stays where it is.
template <class Law, int T = Law::tangents>
std::string return_map_properties(const Law &law, const Local<T> &a, const Local<T> &b) {
    const Tangent<T> still = Tangent<T>::Zero(), a_t = a.template head<T>();
    Local<T> other = b;
    other[T] = a[T];
    const Tangent<T> b_t = other.template head<T>();
    const Local<T> x = return_map(law, a, 0.0, still, 1.0, 1.0).r,
                   y = return_map(law, other, 0.0, still, 1.0, 1.0).r,
                   again = return_map(law, x, 0.0, still, 1.0, 1.0).r;
    const Tangent<T> change = (x - y).template head<T>(), drift = (again - x).template head<T>();
    const double size = slip_length(law, a_t) + slip_length(law, b_t);
    return at_most(slip_length(law, change), slip_length(law, a_t - b_t) + 8 * epsilon * size,
                   "own metric") +
           at_most(load_function(law, x), 8 * epsilon * x[T], "load function of return map") +
           at_most(slip_length(law, drift), 8 * epsilon * size, "return map repeated");
}

/// A pair of reaction and motion that obeys the law: open, sticking or slipping.
template <int T> struct LawfulState {
    Local<T> r;
    double gap;
    Tangent<T> slip;
    Branch branch;
};

template <class Law, int T = Law::tangents>
LawfulState<T> lawful_state(const Law &law, Random &random) {
    LawfulState<T> s{random.reaction(law), 0.0, Tangent<T>::Zero(), Branch(random.below(3))};
    if (s.branch == Branch::open) {
        s.r.setZero();
        s.gap = random.below(4) == 0 ? 0.0 : random.power(-8, 2);
        s.slip = random.tangent<T>();
    } else if (s.branch == Branch::slip) {
        const Tangent<T> e = random.tangent<T>();
        const double R = s.r[T], size = length(e);
        if (size == 0.0)
            return s;
        for (int i = 0; i < T; ++i)
            s.r[i] = law.mu(i) * (R * (e[i] / size));
        s.slip = -random.power(-8, 2) * against_slip(law, s.r);
    }
    return s;
}

/// The three maps leave a lawful pair alone; its gap and its slip defect are zero.
template <class Law, int T = Law::tangents>
std::string lawful_is_fixed(const Law &law, Random &random) {
    const LawfulState<T> s = lawful_state(law, random);
    const double rho = random.power(-3, 3), w = length(scaled_slip(law, s.slip));
    Tangent<T> v, scaled_r;
    for (int i = 0; i < T; ++i) {
        v[i] = law.q2(i) * s.slip[i];
        scaled_r[i] = s.r[i] / law.mu(i);
    }
    // errors are relative to the predictor, whose length the projection may have to bring back
    const double size = length(s.r) + rho * (length(v) + w + s.gap);
    const double scaled = length(scaled_r) + s.r[T] + rho * (w + s.gap);
    std::string wrong = at_most(length(bipotential_map(law, s.r, s.gap, s.slip, rho).r - s.r),
                                16 * epsilon * size, "paper's map moves a lawful pair");
    Local<T> change = scaled_map(law, s.r, s.gap, s.slip, rho).r - s.r;
    for (int i = 0; i < T; ++i)
        change[i] /= law.mu(i);
    wrong += at_most(length(change), 16 * epsilon * scaled, "scaled map moves a lawful pair");
    change = return_map(law, s.r, s.gap, s.slip, rho, 1.0 / rho).r - s.r;
    const Tangent<T> change_t = change.template head<T>(), r_t = s.r.template head<T>();
    wrong += at_most(slip_length(law, change_t),
                     16 * epsilon * (slip_length(law, r_t) + slip_length(law, s.slip / rho)),
                     "return map moves a lawful pair");
    wrong += at_most(std::abs(change[T]), 2 * epsilon * s.r[T], "return map changes R");
    // zero exactly where r, or the motion, is; a rounded r on the boundary is not quite lawful
    wrong += at_most(bipotential_gap(law, s.r, s.gap, s.slip),
                     s.branch == Branch::slip ? 8 * epsilon * s.r[T] * w : 0.0, "gap");
    wrong += at_most(length(slip_defect(law, s.r, s.slip, s.branch)), 8 * epsilon * length(s.slip),
                     "slip defect");
    return wrong;
}

/// For any admissible pair the gap is not negative, and each map moves r by enough to show it, as
/// the variational inequality of its projection says: what a map leaves alone is lawful.
template <class Law, int T = Law::tangents>
std::string only_lawful_is_fixed(const Law &law, Random &random) {
    const Local<T> r = random.reaction(law);
    const double gap = random.below(2) == 0 ? 0.0 : random.power(-8, 1), rho = random.power(-2, 2);
    const Tangent<T> slip = random.tangent<T>(), w = scaled_slip(law, slip);
    const double work = bipotential_gap(law, r, gap, slip), dual = gap + length(w);
    std::string wrong = work >= 0.0 ? "" : "gap is negative; ";
    Local<T> v, scaled_v, x, change;
    for (int i = 0; i < T; ++i) {
        v[i] = law.q2(i) * slip[i];
        scaled_v[i] = w[i];
        x[i] = r[i] / law.mu(i);
    }
    v[T] = scaled_v[T] = dual;
    x[T] = r[T];
    const double slack = 32 * epsilon * (length(x) + length(r) + 1.0) * (1.0 + 1.0 / rho) *
                         (length(v) + length(scaled_v) + length(x) + length(r) + 1.0) * (1.0 + rho);

    const Local<T> paper = bipotential_map(law, r, gap, slip, rho).r;
    wrong += at_most(work, length(paper - r) * (length(paper) / rho + length(v)) + slack,
                     "paper's map leaves an unlawful pair");
    Local<T> y = scaled_map(law, r, gap, slip, rho).r;
    for (int i = 0; i < T; ++i)
        y[i] /= law.mu(i);
    wrong += at_most(work, length(y - x) * (length(y) / rho + length(scaled_v)) + slack,
                     "scaled map leaves an unlawful pair");
    y = return_map(law, r, gap, slip, rho, rho).r;
    double p2 = 0.0;
    for (int i = 0; i < T; ++i) {
        y[i] /= law.mu(i);
        p2 = std::max(p2, law.mu(i) * law.mu(i) * law.q2(i));
    }
    const double moved = length(y - x);
    wrong += at_most(work,
                     moved * (std::max(gap, r[T] / rho) + 2.0 * length(w) + 2.0 * y[T] * p2 / rho) +
                         slack * (1.0 + p2),
                     "return map leaves an unlawful pair");
    return wrong;
}
} // namespace dolfinx_contact::testing
