// Work on many items shared out among threads.
#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "kernel.hpp"

namespace pinsing {

constexpr std::int64_t kChunk = 2048;
constexpr int kMaxThreads = 4096;

// Calls work(first, count) for ranges of the items 0..N-1 on up to `threads` threads, without the GIL.
// It returns whether to go on: ranges are taken in order, and all before one that does not are ended.
template <class Work>
void share_out(std::int64_t N, int threads, Work work, std::int64_t chunk = kChunk) {
    const std::int64_t chunks = (N + chunk - 1) / chunk;
    const int most = static_cast<int>(std::clamp<std::int64_t>(chunks, 1, kMaxThreads));
    std::atomic<std::int64_t> next{0};
    std::atomic<bool> stop{false};
    std::exception_ptr failed;
    std::mutex lock;
    const auto run = [&]() noexcept {
        try {
            while (!stop) {
                const std::int64_t first = next.fetch_add(chunk);
                if (first >= N) break;
                if (!work(first, std::min(chunk, N - first))) stop = true;
            }
        } catch (...) {
            const std::lock_guard<std::mutex> guard(lock);
            failed = std::current_exception();
            stop = true;
        }
    };

    const nanobind::gil_scoped_release release;
    std::vector<std::thread> team;
    for (int i = 1; i < std::clamp(threads, 1, most); i++) {
        try {
            team.emplace_back(run);
        } catch (const std::exception&) {
            break;  // the system gives no more threads: go on with those there are
        }
    }
    run();
    for (std::thread& thread : team) thread.join();
    if (failed) std::rethrow_exception(failed);
}

// A function of the kernel on a batch; returns whether any item is unfinished.
template <class Task>
bool share(Outcome (*function)(const Task&, const Batch&), const Task& task, const Batch& all, int threads) {
    std::atomic<bool> unfinished{false};
    std::mutex lock;
    std::int64_t bad = all.N;  // the least, whichever thread is faster
    share_out(all.N, threads, [&](std::int64_t first, std::int64_t count) {
        Batch some = all;
        some.N = count;
        for (Rows& rows : some.in) rows.at += first * rows.count;
        for (Rows& rows : some.out)
            if (rows.at != nullptr) rows.at += first * rows.count;
        const Outcome outcome = function(task, some);
        if (outcome.unfinished) unfinished = true;
        if (outcome.not_finite < 0) return true;
        const std::lock_guard<std::mutex> guard(lock);
        bad = std::min(bad, first + outcome.not_finite);
        return false;
    });
    if (bad == all.N) return unfinished;
    const std::string item = std::string(all.in[0].name) + "[" + std::to_string(bad) + "]";
    throw nanobind::value_error((item + " holds a value that is not finite").c_str());
}

// Calls each(i) for the items 0..N-1, `chunk` of them at a time.
template <class Each>
void share_each(std::size_t N, int threads, Each each, std::int64_t chunk = kChunk) {
    const auto work = [&](std::int64_t first, std::int64_t count) {
        for (std::int64_t i = first; i < first + count; i++) each(i);
        return true;
    };
    share_out(static_cast<std::int64_t>(N), threads, work, chunk);
}

}  // namespace pinsing
