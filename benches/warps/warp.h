// Runs warps of 32 lanes in lockstep. Lanes that take different branches run one part after the other until they meet at the immediate
// post-dominator of the branch. `lockstep.py` makes the blocks from PTX.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

// Lanes of a warp.
const uint32_t WIDTH = 32;

// Addresses of a kernel's parameters.
extern const void* parameters[];

// Registers of every kernel: the place of a lane in the grid, and its stack.
struct Place {
    uint32_t ctaid_x, ctaid_y, tid_x;
    uint64_t SPL;
};

// A basic block: runs a lane through it and returns the next block; the block where lanes meet again; phases and their instructions.
template <class Lane> struct Block {
    int (*run)(Lane&);
    int meet;
    std::initializer_list<std::pair<int, int>> counts;
};

// Instructions that warps have issued, and the sum of those of their lanes.
struct Cost {
    double issued, operations;
};

// Bytes of a line of memory. Lanes that access one line at the same time share the access.
const uint64_t LINE = 128;

// Lines of memory that warps have accessed, and those of the present block: the number of the access in the block, and the line.
extern double lines;
extern std::vector<std::pair<uint32_t, uint64_t>> accessed;
extern uint32_t accesses;

// Runs the warp whose first invocation is `first`, and adds its cost to that of each phase. `END` is the number of blocks.
typedef void (*Program)(uint32_t first, uint32_t workgroup, Cost* phases);
extern const Program sweep, reading, observe, judge_cycles;
template <class Lane, const Block<Lane>* BLOCKS, int END> void run_warp(uint32_t first, uint32_t workgroup, Cost* phases) {
    // Lanes that are together until they come to the block where the others wait.
    struct Part {
        int block, until;
        uint32_t lanes;
    };
    static Lane warp[WIDTH];
    for (uint32_t n = 0; n < WIDTH; n++) (Place&)warp[n] = {(first + n) / workgroup, 0, (first + n) % workgroup};
    std::vector<Part> parts{{0, END, 0xffffffffu}};
    while (!parts.empty()) {
        Part& part = parts.back();
        if (part.block == part.until) {
            parts.pop_back();
            continue;
        }
        const Block<Lane>& block = BLOCKS[part.block];
        // A branch has two targets.
        int target = -1, other = -1;
        uint32_t taken = 0;
        for (uint32_t rest = part.lanes; rest; rest &= rest - 1) {
            accesses = 0;
            const int n = __builtin_ctz(rest), next = block.run(warp[n]);
            if (!taken) target = next;
            if (next == target) taken |= 1u << n;
            else other = next;
        }
        std::sort(accessed.begin(), accessed.end());
        lines += std::unique(accessed.begin(), accessed.end()) - accessed.begin();
        accessed.clear();
        for (auto [phase, instructions] : block.counts) {
            phases[phase].issued += instructions;
            phases[phase].operations += instructions * __builtin_popcount(part.lanes);
        }
        if (taken == part.lanes) {
            part.block = target;
            continue;
        }
        // Both halves run until they meet. Then all lanes go on.
        const Part halves[] = {{target, block.meet, taken}, {other, block.meet, part.lanes & ~taken}};
        part.block = block.meet;
        parts.insert(parts.end(), std::begin(halves), std::end(halves));
    }
}

// Converts an operand: numbers of equal size bit by bit.
template <class To, class From> To as(From from) {
    if (sizeof(To) != sizeof(From)) return To(from);
    To to;
    memcpy(&to, &from, sizeof to);
    return to;
}
template <class To, class From> void set(To& to, From from) { to = as<To>(from); }
template <class T> T& at(uint64_t address) { return *(T*)address; }
template <class T> T& global(uint64_t address) {
    accessed.push_back({accesses++, address / LINE});
    return at<T>(address);
}

template <class T> T shifted_left(T a, uint32_t by) { return by < 8 * sizeof a ? a << by : 0; }
template <class T> T shifted_right(T a, uint32_t by) { return by < 8 * sizeof a ? a >> by : 0; }

// Conversions by rounding: towards zero, down, to the nearest integer, and to the nearest number.
template <class To> To converted_rzi(float a) {
    if (!std::numeric_limits<To>::is_integer) return std::trunc(a);
    const double least = std::numeric_limits<To>::lowest(), most = std::numeric_limits<To>::max();
    return std::isnan(a) ? To(0) : To(std::fmin(std::fmax(a, least), most));
}
template <class To> To converted_rmi(float a) { return std::floor(a); }
template <class To> To converted_rni(float a) { return std::rint(a); }
template <class To, class From> To converted_rn(From a) { return To(a); }
