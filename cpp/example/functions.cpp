// Copyright (c) 2026 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
// Functions of one node, and a loop over nodes: what docs/cpp.md shows.
#include <cmath>
#include <dolfinx_contact/law/batch.h>
#include <iostream>

namespace dc = dolfinx_contact;

/// One node: the law of its friction, a projection, the three maps with their derivatives, and what
/// says that the law holds.
bool one_node() {
    const dc::Tangent<2> mu(0.30, 0.15), p(0.05, 0.20);  // along the grooves, across
    const dc::Tangent<2> q = dc::normalised_q<2>(mu, p); // Q = P M^-1, largest entry 1
    const dc::NonAssociated<2> law{mu, q.cwiseAbs2()};   // no units
    const dc::Local<2> tau(5.0, 2.0, 10.0);              // N: two tangential components, normal
    const auto [r, branch] = dc::project(law, tau);      // N, in the friction cone
    const double f = dc::load_function(law, r);          // N, zero on the surface of the cone
    const dc::Tangent<2> direction = dc::against_slip(law, r); // unit vector
    const dc::Tangent<2> slip = -1e-3 * direction;             // mm, as the slip rule wants it
    const dc::Tangent<2> left = dc::slip_defect(law, r, slip, branch); // mm
    const double gap = dc::bipotential_gap(law, r, 0.0, slip); // N mm, zero where the law holds
    const double rho = 5e4;                                    // N/mm
    const dc::Local<2> predicted = dc::predictor(law, r, 0.0, slip, rho); // N
    const auto same = dc::project(law, predicted);                        // r again: the law holds
    const auto bipotential = dc::bipotential_jacobian(law, r, 0.0, slip, rho);
    const auto scaled = dc::scaled_jacobian(law, r, 0.0, slip, rho);
    const auto returned = dc::return_jacobian(law, r, 0.0, slip, rho, rho);
    std::cout << "r = " << r.transpose() << " N, f = " << f << " N\nd r / d (slip, gap), N/mm:\n"
              << returned.by_motion << '\n';
    const double small = 1e-12 * r.norm();
    const auto fixed = [&, r = r](const dc::Local<2> &again) { return (again - r).norm() < small; };
    return branch == dc::Branch::slip && std::abs(f) < small && left.norm() < 1e-15 &&
           std::abs(gap) < small && fixed(same.r) &&
           fixed(dc::bipotential_map(law, r, 0.0, slip, rho).r) && fixed(bipotential.value.r) &&
           fixed(dc::scaled_map(law, r, 0.0, slip, rho).r) && fixed(scaled.value.r) &&
           fixed(dc::return_map(law, r, 0.0, slip, rho, rho).r) && fixed(returned.value.r);
}

/// Many nodes: arrays of reactions, gaps and slips, one row a node, through one map. The kind of
/// the law is found from its coefficients, once.
bool many_nodes() {
    constexpr std::size_t n = 2;
    const double gap[n] = {0.0, 0.1}, slip[2 * n] = {0.0, 1e-3, 0.0, 0.0}, rho[n] = {5e4, 5e4};
    double r[3 * n] = {0.0, 0.0, 10.0, 0.0, 0.0, 0.0}; // N
    std::uint8_t status[n];
    dc::Inputs in;
    in.r = {r, 3, 1}; // component j of node i is r[3 i + j]
    in.gap = {gap, 1, 0};
    in.slip = {slip, 2, 1};
    in.rho_n = {rho, 1, 0};
    dc::Outputs out;
    out.value = {r, 3, 1}; // in place
    out.branch = {status, 1, 0};
    const auto law = dc::make_law<2>({{0.30, 0.15}}, {{0.05, 0.20}}, true);
    std::visit(
        [&](const auto &source) { dc::for_each_node(source, n, in, out, dc::BipotentialMap{}); },
        law);
    std::cout << "reactions " << r[0] << ' ' << r[1] << ' ' << r[2] << " N; second node open: "
              << (status[1] == static_cast<std::uint8_t>(dc::Branch::open)) << '\n';
    return status[0] == static_cast<std::uint8_t>(dc::Branch::slip) && r[1] < 0.0 &&
           status[1] == 0 && r[5] == 0.0;
}

int main() { return one_node() && many_nodes() ? 0 : 1; }
