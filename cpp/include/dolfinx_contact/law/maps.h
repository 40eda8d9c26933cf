// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file maps.h
/// The functions of one node as function objects of a law and a State, for for_each_node of
/// batch.h.
#pragma once

#include "bipotential.h"
#include "return_map.h"
#include "slip_rule.h"
namespace dolfinx_contact {
/// What a function of one node may look at.
template <int T> struct State {
    Local<T> r;
    double gap;
    Tangent<T> slip;
    double rho_n, rho_t;
    Branch branch;
};

struct EuclideanProjection {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return project(law, s.r);
    }
};

struct BipotentialMap {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return bipotential_map(law, s.r, s.gap, s.slip, s.rho_n);
    }
};

struct ScaledMap {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return scaled_map(law, s.r, s.gap, s.slip, s.rho_n);
    }
};

struct ReturnMap {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return return_map(law, s.r, s.gap, s.slip, s.rho_n, s.rho_t);
    }
};

struct LoadFunction {
    template <class Law, class S> double operator()(const Law &law, const S &s) const {
        return load_function(law, s.r);
    }
};

struct BipotentialGap {
    template <class Law, class S> double operator()(const Law &law, const S &s) const {
        return bipotential_gap(law, s.r, s.gap, s.slip);
    }
};

struct SlipDefect {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return slip_defect(law, s.r, s.slip, s.branch);
    }
};

// Derivatives.

struct BipotentialJacobian {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return bipotential_jacobian(law, s.r, s.gap, s.slip, s.rho_n);
    }
};

struct ScaledJacobian {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return scaled_jacobian(law, s.r, s.gap, s.slip, s.rho_n);
    }
};

struct ReturnJacobian {
    template <class Law, class S> auto operator()(const Law &law, const S &s) const {
        return return_jacobian(law, s.r, s.gap, s.slip, s.rho_n, s.rho_t);
    }
};
} // namespace dolfinx_contact
