// Work on many items shared out among threads.
#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "kernel.hpp"

namespace pinsing {

constexpr std::int64_t kChunk = 2048;
constexpr int kMaxThreads = 4096;

struct FreeAligned {
    void operator()(double* p) const {
        ::operator delete(p, std::align_val_t(kScratchAlign));
    }
};
using Scratch = std::unique_ptr<double, FreeAligned>;

inline Scratch allocate(std::size_t doubles) {
    return Scratch(static_cast<double*>(
        ::operator new(doubles * sizeof(double), std::align_val_t(kScratchAlign))));
}

// Runs item ranges on up to `threads` threads, without the GIL.
// work(first, count, scratch) -> Outcome with indices relative to first.
template <class Work>
Outcome share_out(std::int64_t N, int threads, std::size_t scratch, Work work,
                  std::int64_t chunk = kChunk) {
    const std::int64_t chunks = (N + chunk - 1) / chunk;
    const int most = static_cast<int>(std::clamp<std::int64_t>(chunks, 1, kMaxThreads));
    const int workers = std::clamp(threads, 1, most);
    std::vector<Scratch> memory;
    for (int i = 0; i < workers; i++) memory.push_back(allocate(scratch));
    std::vector<std::thread> team;
    team.reserve(static_cast<std::size_t>(workers));

    std::atomic<std::int64_t> next{0};
    std::atomic<bool> stop{false};
    std::mutex lock;
    Outcome total{-1, 0};
    // Chunks are taken in order and each runs to its first bad item, so the least one is found
    // whichever thread is faster.
    auto run = [&](int worker) noexcept {
        while (!stop.load(std::memory_order_relaxed)) {
            const std::int64_t first = next.fetch_add(chunk);
            if (first >= N) break;
            const Outcome part = work(first, std::min(chunk, N - first), memory[worker].get());
            if (part.not_finite < 0 && part.unfinished == 0) continue;
            const std::lock_guard<std::mutex> guard(lock);
            total.unfinished += part.unfinished;
            if (part.not_finite >= 0) {
                const std::int64_t item = first + part.not_finite;
                if (total.not_finite < 0 || item < total.not_finite) total.not_finite = item;
                stop = true;
            }
        }
    };

    const nanobind::gil_scoped_release release;
    for (int i = 1; i < workers; i++) {
        try {
            team.emplace_back(run, i);
        } catch (const std::exception&) {
            break;  // the system gives no more threads: go on with those there are
        }
    }
    run(0);
    for (std::thread& thread : team) thread.join();
    return total;
}

// The same of an array `name` that has to be finite; returns how many items are unfinished.
template <class Work>
std::int64_t share_finite(const char* name, std::size_t N, int threads, std::size_t scratch, Work work) {
    const Outcome outcome = share_out(static_cast<std::int64_t>(N), threads, scratch, work);
    if (outcome.not_finite < 0) return outcome.unfinished;
    const std::string item = std::string(name) + "[" + std::to_string(outcome.not_finite) + "]";
    throw nanobind::value_error((item + " holds a value that is not finite").c_str());
}

// Calls each(i) for the items 0..N-1, `chunk` of them at a time.
template <class Each>
void share_each(std::size_t N, int threads, Each each, std::int64_t chunk = kChunk) {
    const auto work = [&](std::int64_t first, std::int64_t count, double*) {
        for (std::int64_t i = first; i < first + count; i++) each(i);
        return Outcome{-1, 0};
    };
    share_out(static_cast<std::int64_t>(N), threads, 1, work, chunk);
}

}  // namespace pinsing
