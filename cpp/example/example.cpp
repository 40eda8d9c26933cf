// Copyright (c) 2026 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
// A node pressed and dragged over a plane with orthotropic friction: one predictor and corrector.
#include <dolfinx_contact/law/bipotential.h>
#include <iostream>

int main() {
    namespace dc = dolfinx_contact;
    const dc::Associated<2> law{{0.3, 0.15}};                             // mu_x, mu_y
    const dc::Local<2> pressed(0.0, 0.0, 10.0);                           // r_x, r_y, r_n
    const dc::Tangent<2> slip(-1e-3, -1e-3);                              // slip increment
    const auto after = dc::bipotential_map(law, pressed, 0.0, slip, 5e4); // gap 0, metric 5e4
    std::cout << "r = " << after.r.transpose() << ", f = " << dc::load_function(law, after.r)
              << '\n';
    return after.branch == dc::Branch::slip ? 0 : 1;
}
