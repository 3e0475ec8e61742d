// Runs lanes of a map on a simulated card and prints how many instructions it issues, by phase of the work.
//
//     simulate FOLDER brute|decided PERIODS
//
// The host sorts the lanes as shaders/lists.wgsl does, every PERIODS periods and before cycles are judged. The cost of sorting is not counted.

#include <cstdio>
#include <fstream>
#include <map>
#include <numeric>
#include <string>
#include <utility>

#include "cuda.h"
#include "phases.h"
#include "warp.h"
// Entry points for the host. Each file declares the structs and constants of the shader that it uses.
namespace begins {
#include "begin.cu"
}
namespace sorts {
#include "keys.cu"
}
namespace shader {
#include "judge_cycles.cu"
}
using namespace shader;

// Periods of lanes that do not end early.
const uint32_t BRUTE_PERIODS = 110;
const void* parameters[16];
double lines;
std::vector<std::pair<uint32_t, uint64_t>> accessed;
uint32_t accesses;

template <class T> std::vector<T> read(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    const std::vector<char> bytes(std::istreambuf_iterator<char>(in), {});
    std::vector<T> items(bytes.size() / sizeof(T));
    memcpy(items.data(), bytes.data(), items.size() * sizeof(T));
    return items;
}

int main(int, char** arguments) {
    const std::string folder = std::string(arguments[1]) + "/", map = arguments[2];
    auto settings = read<Settings>(folder + "settings.bin").at(0);
    const int length = std::stoi(arguments[3]);
    if (map == "brute") {
        settings.early_stop = settings.hands_over = 0;
        settings.periods = settings.decided_by = settings.longest = BRUTE_PERIODS;
    }
    auto cells = read<Cell>(folder + "cells.bin");
    auto shapes = read<FlowShape>(folder + "shapes.bin");
    auto starts = read<float>(folder + "starts.bin"), flows = read<float>(folder + "flows.bin");
    auto pairs = read<float>(folder + "pairs.bin"), laws = read<float>(folder + "laws.bin");
    const uint32_t n = cells.size();
    std::vector<Motion> motions(n);
    std::vector<Tally> tallies(n);
    std::vector<uint32_t> keys(n), numbers(offsetof(Queue, lanes) / sizeof(uint32_t) + 2 * n);
    Queue& queue = *(Queue*)numbers.data();
    uint32_t* const active = (uint32_t*)&queue.lanes;
    std::iota(active, active + n, 0);

    // In the order of BUFFERS in cuda.py. A kernel gets the settings themselves and the addresses of the other buffers.
    void* buffers[] = {&settings, cells.data(), motions.data(), tallies.data(), &queue, starts.data(), shapes.data(), flows.data(),
                       pairs.data(), laws.data(), keys.data()};
    std::transform(std::begin(buffers), std::end(buffers), parameters, [](void*& buffer) { return &buffer; });
    parameters[0] = &settings;
    for (uint32_t i = 0; i < n; i++) begins::run(i, buffers);

    Cost phases[std::size(PHASES)] = {}, all = {};
    auto make_lists = [&] {
        for (uint32_t i = 0; i < n; i++) sorts::run(i, buffers);
        uint32_t* const sorted = std::copy(active, active + n, active + n) - n;
        std::stable_sort(sorted, sorted + n, [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
        for (uint32_t list = 0, begin = 0; list < LISTS; list++) {
            auto is_listed = [&](uint32_t key) { return key / (KEYS / LISTS) == list; };
            queue.begins.inner[list] = begin;
            begin += queue.counts.inner[list] = std::count_if(keys.begin(), keys.end(), is_listed);
        }
        queue.counts.inner[LIST_OBSERVE] = std::exchange(queue.begins.inner[LIST_OBSERVE], 0);
    };
    std::map<std::string, double> lines_of;
    auto run = [&](const char* kernel, Program program, uint32_t list) {
        const uint32_t lanes = queue.counts.inner[list];
        const double before = lines;
        for (uint32_t first = 0; first < lanes; first += WIDTH) program(first, WORKGROUP, phases);
        lines_of[kernel] += lines - before;
    };
    uint32_t rounds = 0;
    for (make_lists(); queue.counts.inner[LIST_ENDED] < n; rounds++) {
        for (int period = 0; period < length; period++) {
            run("sweep", sweep, OWN_LIST);
            run("reading", reading, LIST_READING);
            run("observe", observe, LIST_OBSERVE);
        }
        make_lists();
        run("judge_cycles", judge_cycles, LIST_JUDGE);
        make_lists();
    }

    double periods = 0;
    uint32_t failures = 0;
    std::map<uint32_t, int> cycles;
    for (const Tally& tally : tallies) {
        periods += tally.now.period;
        failures += tally.now.status != STATUS_OK;
        cycles[tally.search.cycle]++;
    }
    printf("%s: %u lanes, %u of them failed, %.1f periods per lane, %u rounds", map.c_str(), n, failures, periods / n, rounds);
    printf("\nperiod of the cycle (lanes):");
    for (auto [cycle, count] : cycles) printf(" %u (%d)", cycle, count);
    printf("\n\n| phase | operations per lane-period | issued per 32 lane-periods | active |\n| --- | --- | --- | --- |\n");
    auto row = [&](const char* name, Cost cost) {
        const double active = cost.operations / (WIDTH * cost.issued);
        printf("| %s | %.0f | %.0f | %.2f |\n", name, cost.operations / periods, WIDTH * cost.issued / periods, active);
    };
    for (size_t k = 0; k < std::size(PHASES); k++) {
        row(PHASES[k], phases[k]);
        all = {all.issued + phases[k].issued, all.operations + phases[k].operations};
    }
    row("**all**", all);
    printf("\n| kernel | lines of memory per 32 lane-periods |\n| --- | --- |\n");
    for (auto [kernel, lines] : lines_of) printf("| %s | %.0f |\n", kernel.c_str(), WIDTH * lines / periods);
    printf("| **all** | %.0f |\n", WIDTH * lines / periods);
}
