// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file bench_kernel.cpp
/// Nanoseconds per node of each law and map, for n = 1e2 ... 1e7 nodes, on a mix of branches (a
/// third each open, sticking, slipping, in random order) and on each branch alone. Beside it the
/// bytes that a node's arrays hold and the bandwidth that moving them at this speed amounts to, as
/// a fraction of that of a triad with the same number of bytes, measured in the same run.
///
/// Arrays are by component (each component of all nodes contiguous), or by node with --by-node.
#include <benchmark/benchmark.h>
#include <chrono>
#include <cstring>
#include <dolfinx_contact/batch.h>
#include <iostream>
#include <map>
#include <random>

using namespace dolfinx_contact;

namespace {
bool by_node = false;

/// n nodes of N components.
struct Array {
    std::size_t n, components;
    std::vector<double> data;
    Array(std::size_t n, std::size_t components)
        : n(n), components(components), data(n * components) {}
    std::ptrdiff_t row() const { return by_node ? static_cast<std::ptrdiff_t>(components) : 1; }
    std::ptrdiff_t column() const { return by_node ? 1 : static_cast<std::ptrdiff_t>(n); }
    double &operator()(std::size_t i, int j = 0) {
        return data[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(i) * row() +
                                             j * column())];
    }
    View<const double> in() const { return {data.data(), row(), column()}; }
    View<double> out() { return {data.data(), row(), column()}; }
};

enum class Mix { all, open, stick, slip };

const std::vector<std::pair<Mix, const char *>> mixes{
    {Mix::all, "mix"}, {Mix::open, "open"}, {Mix::stick, "stick"}, {Mix::slip, "slip"}};

/// States whose predictor has the wanted branch for every map: clearly open, clearly inside the
/// cone, or clearly outside of it and of its polar.
struct Contact {
    Array r, gap, slip, rho, value;
    std::vector<std::uint8_t> branch;

    Contact(std::size_t n, Mix mix)
        : r(n, 3), gap(n, 1), slip(n, 2), rho(n, 1), value(n, 3), branch(n) {
        std::mt19937_64 engine(1);
        std::uniform_real_distribution<double> unit(0.0, 1.0);
        std::uniform_int_distribution<int> third(1, 3);
        for (std::size_t i = 0; i < n; ++i) {
            const Mix status = mix == Mix::all ? static_cast<Mix>(third(engine)) : mix;
            const double angle = 6.283185307179586 * unit(engine);
            const double size = status == Mix::stick ? 0.02 : (status == Mix::slip ? 1.0 : 0.1);
            r(i, 2) = status == Mix::open ? 0.0 : 1.0 + unit(engine);
            rho(i) = 1.0 + 0.1 * unit(engine);
            gap(i) = status == Mix::open ? 1.0 + unit(engine) : 0.0;
            slip(i, 0) = size * (1.0 + unit(engine)) * std::cos(angle);
            slip(i, 1) = size * (1.0 + unit(engine)) * std::sin(angle);
            if (status == Mix::slip) // the point to project, where there is no predictor
                r(i, 0) = -2.0 * slip(i, 0), r(i, 1) = -2.0 * slip(i, 1);
        }
    }

    Inputs inputs() const {
        Inputs in;
        in.r = r.in();
        in.gap = gap.in();
        in.slip = slip.in();
        in.rho_n = in.rho_t = rho.in();
        return in;
    }
    Outputs outputs() {
        Outputs out;
        out.value = value.out();
        out.branch = {branch.data(), 1, 0};
        return out;
    }
};

/// Seconds per byte of a triad a = b + s c over arrays of `bytes` in all, reading and writing.
double seconds_per_byte(std::size_t bytes) {
    static std::map<std::size_t, double> known;
    if (known.count(bytes) != 0)
        return known[bytes];
    const std::size_t n = std::max<std::size_t>(bytes / 24, 16);
    std::vector<double> a(n), b(n, 1.0), c(n, 2.0);
    double best = 1e300;
    const std::size_t sweeps = std::max<std::size_t>(1, 3000000 / n);
    for (int repeat = 0; repeat < 10; ++repeat) {
        const auto start = std::chrono::steady_clock::now();
        for (std::size_t sweep = 0; sweep < sweeps; ++sweep) {
            for (std::size_t i = 0; i < n; ++i)
                a[i] = b[i] + 3.0 * c[i];
            benchmark::ClobberMemory();
        }
        const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
        best = std::min(best, time.count() / static_cast<double>(24 * n * sweeps));
    }
    return known[bytes] = best;
}

/// Bytes of a node in the arrays of a map: r and its result, branch; gap, slip, rho where it has
/// them.
template <class F>
std::size_t bytes_of_node(int tangents, bool field_coefficients, std::size_t law) {
    const std::size_t T = static_cast<std::size_t>(tangents), vector = 8 * (T + 1);
    const std::size_t coefficients = field_coefficients ? law : 0;
    if (std::is_same_v<F, EuclideanProjection>)
        return 2 * vector + 1 + coefficients;
    if (std::is_same_v<F, BipotentialGap>)
        return vector + 8 + 8 * T + 8 + coefficients;
    const std::size_t metrics = std::is_same_v<F, ReturnMap> ? 16 : 8;
    return 2 * vector + 1 + 8 + 8 * T + metrics + coefficients;
}

template <class Source, class F> void run(benchmark::State &state, Source source, F f, Mix mix) {
    const auto n = static_cast<std::size_t>(state.range(0));
    Contact contact(n, mix);
    const Inputs in = contact.inputs();
    const Outputs out = contact.outputs();
    for (auto _ : state) {
        for_each_node(source, n, in, out, f);
        benchmark::ClobberMemory();
    }
    using Law = typename Source::Law;
    const bool field = std::is_same_v<Source, Field<Law>>;
    const auto bytes =
        static_cast<double>(bytes_of_node<F>(Law::tangents, field, field ? sizeof(Law) : 0));
    using benchmark::Counter;
    const auto nodes = static_cast<double>(n);
    state.counters["ns/node"] =
        Counter(nodes * 1e-9, Counter::kIsIterationInvariantRate | Counter::kInvert);
    state.counters["B/node"] = bytes;
    // moving all its bytes at the triad's speed would take this share of the time
    state.counters["of_triad"] =
        Counter(bytes * nodes * seconds_per_byte(static_cast<std::size_t>(bytes * nodes)),
                Counter::kIsIterationInvariantRate);
}

template <class Source, class F>
void add(const std::string &law, const char *map, const Source &source, F f) {
    for (const auto &named : mixes) {
        const Mix mix = named.first;
        auto *bench = benchmark::RegisterBenchmark(
            (law + "/" + map + "/" + named.second).c_str(),
            [=](benchmark::State &state) { run(state, source, f, mix); });
        bench->RangeMultiplier(10)->Range(100, 10000000);
    }
}

template <class Source> void add_maps(const std::string &law, const Source &source) {
    add(law, "project", source, EuclideanProjection{});
    add(law, "bipotential_map", source, BipotentialMap{});
    add(law, "scaled_map", source, ScaledMap{});
    add(law, "return_map", source, ReturnMap{});
    add(law, "bipotential_gap", source, BipotentialGap{});
}
} // namespace

int main(int argc, char **argv) {
    for (int i = 1; i < argc; ++i)
        if (std::strcmp(argv[i], "--by-node") == 0) {
            by_node = true;
            std::swap(argv[i], argv[--argc]);
        }
    add_maps("frictionless", Uniform<Frictionless>{});
    add_maps("isotropic", Uniform<Isotropic<2>>{{0.2}});
    add_maps("associated", Uniform<Associated<2>>{{{0.3, 0.15}}});
    add_maps("nonassociated", Uniform<NonAssociated<2>>{{{0.3, 0.15}, {0.0156, 1.0}}});
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv))
        return 1;
    benchmark::RunSpecifiedBenchmarks();
}
