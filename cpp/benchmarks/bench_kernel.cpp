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
#include <cstring>
#include <ctime>
#include <dolfinx_contact/law/batch.h>
#include <map>
#include <memory>
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
        const std::clock_t start = std::clock();
        for (std::size_t sweep = 0; sweep < sweeps; ++sweep) {
            for (std::size_t i = 0; i < n; ++i)
                a[i] = b[i] + 3.0 * c[i];
            benchmark::ClobberMemory();
        }
        const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
        best = std::min(best, seconds / static_cast<double>(24 * n * sweeps));
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

/// The contact of these benchmarks, kept until another is asked for.
Contact &contact_of(std::size_t n, Mix mix) {
    static std::unique_ptr<Contact> last;
    static Mix last_mix{};
    if (last == nullptr || last->branch.size() != n || last_mix != mix) {
        last.reset(); // the memory of two would be much
        last = std::make_unique<Contact>(n, mix);
        last_mix = mix;
    }
    return *last;
}

template <class Source, class F>
void run(benchmark::State &state, Source source, F f, std::size_t n, Mix mix) {
    Contact &contact = contact_of(n, mix);
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

/// All maps of one law for one contact.
template <class Source>
void add(const char *law, const Source &source, std::size_t n, Mix mix, const char *mix_name) {
    const auto add_map = [&](const char *map, auto f) {
        std::ostringstream name;
        name << law << "/" << map << "/" << mix_name << "/" << n;
        benchmark::RegisterBenchmark(
            name.str().c_str(), [=](benchmark::State &state) { run(state, source, f, n, mix); });
    };
    add_map("project", EuclideanProjection{});
    add_map("bipotential_map", BipotentialMap{});
    add_map("scaled_map", ScaledMap{});
    add_map("return_map", ReturnMap{});
    add_map("bipotential_gap", BipotentialGap{});
}
} // namespace

int main(int argc, char **argv) {
    for (int i = 1; i < argc; ++i)
        if (std::strcmp(argv[i], "--by-node") == 0) {
            by_node = true;
            std::swap(argv[i], argv[--argc]);
        }
    for (std::size_t n = 100; n <= 10000000; n *= 10)
        for (const auto &[mix, name] : mixes) {
            add("frictionless", Uniform<Frictionless>{}, n, mix, name);
            add("isotropic", Uniform<Isotropic<2>>{{0.2}}, n, mix, name);
            add("associated", Uniform<Associated<2>>{{{0.3, 0.15}}}, n, mix, name);
            add("nonassociated", Uniform<NonAssociated<2>>{{{0.3, 0.15}, {0.0156, 1.0}}}, n, mix,
                name);
        }
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv))
        return 1;
    benchmark::RunSpecifiedBenchmarks();
}
