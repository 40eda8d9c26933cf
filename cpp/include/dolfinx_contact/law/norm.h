// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file norm.h
/// Euclidean norm that neither overflows nor underflows, by exact scaling with powers of two.
#pragma once

#include "friction.h"
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace dolfinx_contact {
/// Added to a length that is a divisor, against 0 / 0; lengths above 1e-291 stay what they are.
inline constexpr double tiny = std::numeric_limits<double>::min();

/// Two powers of two whose product is one.
struct PowerOfTwo {
    double down, up;
};

/// The power of two for which magnitude * down lies in [4, 8); less for magnitude < 2^-960, zero
/// included. Bits of the exponent, no library call.
inline PowerOfTwo power_of_two(double magnitude) {
    constexpr std::uint64_t exponent = 0x7ffULL << 52U, twice_bias = 2046ULL << 52U;
    const double within_range = 0.25 * magnitude + 0x1p-1021; // so that up and down are normal
    std::uint64_t bits = 0;
    std::memcpy(&bits, &within_range, sizeof bits);
    const std::uint64_t up_bits = bits & exponent, down_bits = twice_bias - up_bits;
    PowerOfTwo scale{};
    std::memcpy(&scale.up, &up_bits, sizeof bits);
    std::memcpy(&scale.down, &down_bits, sizeof bits);
    return scale;
}

/// max |v_i|
template <int N, class Real> Real largest(const Eigen::Matrix<Real, N, 1> &v) {
    Real magnitude = std::abs(v[0]);
    for (int i = 1; i < N; ++i)
        magnitude = std::max(magnitude, std::abs(v[i]));
    return magnitude;
}

/// |v|, for all finite v whose norm is representable; in long double without scaling.
template <int T, class Real> Real norm(const Tangent<T, Real> &v) {
    if constexpr (T == 0)
        return 0.0;
    else if constexpr (T == 1)
        return std::abs(v[0]);
    else if constexpr (!std::is_same_v<Real, double>)
        return std::sqrt(v.squaredNorm());
    else {
        const PowerOfTwo scale = power_of_two(largest<T>(v));
        double sum = 0.0;
        for (int i = 0; i < T; ++i) {
            const double x = v[i] * scale.down;
            sum += x * x;
        }
        return std::sqrt(sum) * scale.up;
    }
}
} // namespace dolfinx_contact
