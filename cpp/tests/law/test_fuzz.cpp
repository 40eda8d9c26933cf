// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// The properties of properties.h at a million random states, or as many as
/// DOLFINX_CONTACT_FUZZ_DRAWS says; DOLFINX_CONTACT_FUZZ_SEED chooses others. And the number of
/// Newton steps, there and where it is largest.
#include "properties.h"
#include <cstdlib>
#include <gtest/gtest.h>
#include <iostream>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;

namespace {
double setting(const char *name, double otherwise) {
    const char *given = std::getenv(name);
    return given != nullptr ? std::strtod(given, nullptr) : otherwise;
}

int most_steps = 0; // Newton steps of a secular equation

template <class Law> std::string check(const Law &law, Random &random) {
    constexpr int T = Law::tangents;
    const double scale = random.below(4) == 0 ? random.power(-150, 150) : 1.0;
    const Local<T> a = scale * random.point(law);
    const bool near = random.below(2) == 0;
    const Local<T> other = scale * random.point(law);
    const Local<T> b = near ? Local<T>(a + random.power(-17, -1) * other) : other;
    std::string wrong = projection_properties(law, a, random) + non_expansive(law, a, b);
    wrong += return_map_properties(law, a, b) + scaled_map_properties(law, a, b);
    if constexpr (!is_isotropic<Law>)
        most_steps = std::max(most_steps, newton_steps(law, a));
    return wrong + lawful_is_fixed(law, random) + only_lawful_is_fixed(law, random);
}

std::string check_any(Random &random) {
    const int kind = random.below(5);
    if (kind == 0)
        return check(Isotropic<1>{random.coefficients<1>()[0]}, random);
    if (kind == 1)
        return check(Isotropic<2>{random.coefficients<1>()[0]}, random);
    const Tangent<2> mu = random.coefficients<2>();
    if (kind == 2)
        return check(Associated<2>{mu}, random);
    const Tangent<2> p = random.coefficients<2>(), q = normalised_q<2>(mu, p),
                     same = normalised_q<2>(mu, random.power(-9, 9) * p);
    return at_most((same - q).cwiseQuotient(q).cwiseAbs().maxCoeff(), 4 * epsilon, "scale of p") +
           check(NonAssociated<2>{mu, q.cwiseAbs2()}, random);
}
} // namespace

TEST(Fuzz, all_properties_at_random_states) {
    const auto draws = std::llround(setting("DOLFINX_CONTACT_FUZZ_DRAWS", 1e6));
    Random random(static_cast<std::uint64_t>(setting("DOLFINX_CONTACT_FUZZ_SEED", 1)));
    long long wrong = 0;
    for (long long draw = 0; draw < draws; ++draw) {
        const std::string what = check_any(random);
        if (!what.empty() && ++wrong <= 10)
            ADD_FAILURE() << "draw " << draw << ": " << what;
    }
    EXPECT_EQ(wrong, 0) << "of " << draws << " draws";
    std::cout << "most Newton steps at a random state: " << most_steps << "\n";
    EXPECT_LE(most_steps, 20);
}

// In the slowest case (secular.h) Newton's method needs the number of steps foretold, not the
// bound: a term that is 1 at s = 0, or nearly so, and hardly depends on s.
TEST(Secular, newton_steps_in_the_slowest_case) {
    Random random(2);
    int most = 0;
    for (int draw = 0; draw < 200000; ++draw) {
        const double a = random.power(-3, 0), c = a * (1.0 + random.power(-17, -1));
        const double ratio = random.power(-100, 0);
        const SecularEquation<2> equation{{a, random.power(-3, 3)}, {ratio, 1.0}, {c, c}};
        if (std::abs(equation.a[1]) > c) // so that phi(0) > 1
            most = std::max(most, solve(equation).steps);
    }
    EXPECT_GT(most, 40);
    EXPECT_LE(most, 46);
}
