// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// The properties of properties.h at a million random states, or as many as
/// DOLFINX_CONTACT_FUZZ_DRAWS says; DOLFINX_CONTACT_FUZZ_SEED chooses others.
#include "properties.h"
#include <cstdlib>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;

namespace {
double setting(const char *name, double otherwise) {
    const char *given = std::getenv(name);
    return given ? std::strtod(given, nullptr) : otherwise;
}

template <class Law> std::string check(const Law &law, Random &random) {
    constexpr int T = Law::tangents;
    const double scale = random.below(4) == 0 ? random.power(-150, 150) : 1.0;
    const Local<T> a = scale * random.point(law);
    const bool near = random.below(2) == 0;
    const Local<T> other = scale * random.point(law);
    const Local<T> b = near ? Local<T>(a + random.power(-17, -1) * other) : other;
    std::string wrong = projection_properties(law, a, random) + non_expansive(law, a, b);
    wrong += return_map_properties(law, Local<T>(a / scale), Local<T>(b / scale));
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
    return check(NonAssociated<2>{mu, normalised_q<2>(mu, random.coefficients<2>()).cwiseAbs2()},
                 random);
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
}
