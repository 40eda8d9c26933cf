// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file slip_rule.h
/// The slip rule -du_t = dlambda P^-2 r_t / |P^-1 r_t| of [dSFMH07, Section 1].
#pragma once

#include "norm.h"

namespace dolfinx_contact {
/// 1 / p_i^2 = 1 / (mu_i q_i)^2, scaled to a maximum of 1.
template <class Law, int T = Law::tangents> Tangent<T> inverse_p_squared(const Law &law) {
    if constexpr (is_isotropic<Law>)
        return Tangent<T>::Ones();
    else {
        Tangent<T> p2;
        for (int i = 0; i < T; ++i)
            p2[i] = divisor(law, i) * divisor(law, i) * law.q2(i);
        return p2.cwiseInverse() * p2.minCoeff();
    }
}

/// Unit vector along P^-2 r_t, against which the node slips; zero for r_t = 0.
template <class Law, int T = Law::tangents>
Tangent<T> against_slip(const Law &law, const Local<T> &r) {
    const Tangent<T> r_t = r.template head<T>();
    const PowerOfTwo scale = power_of_two(largest<T>(r_t));
    const Tangent<T> d = inverse_p_squared(law).cwiseProduct(r_t * scale.down);
    const double length = norm<T>(d);
    return length > 0.0 ? Tangent<T>(d / length) : Tangent<T>(Tangent<T>::Zero());
}

/// What of the slip increment the law does not explain, a length: |du + |du| d| with d from
/// against_slip on a slipping node, |du| on a sticking one, zero on an open or frictionless one.
template <class Law, int T = Law::tangents>
double slip_defect(const Law &law, const Local<T> &r, const Tangent<T> &slip, Branch branch) {
    if (branch == Branch::open || law.mu(0) == 0.0)
        return 0.0;
    const double length = norm<T>(slip);
    if (branch == Branch::stick)
        return length;
    return norm<T>(slip + length * against_slip(law, r));
}
} // namespace dolfinx_contact
