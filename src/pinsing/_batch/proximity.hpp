// How far a configuration is from conditions, and where a motion meets them; one at a time.
#pragma once

#include <cstdint>

#include "conditions.hpp"

namespace pinsing {

// Search for the nearest point of the conditions, and the proof that none is nearer.
struct SearchOptions {
    const double* lower;  // limits in weighted coordinates, infinite where there are none
    const double* upper;
    int stride;           // from those of one family to those of the next; 0 for the same
    bool limited;         // only points within the limits count
    double far;           // how far prismatic joints are looked at where nothing bounds them
    double gap;
    std::int64_t boxes;   // most boxes for a configuration
};

struct Nearest {
    double lower, upper;  // infinite where there is no point
    std::int64_t family;  // of the nearest point found; -1 for none
    std::int64_t boxes;
};

// Nearest point of the conditions to x (n,), put into point (n,), and how near one can be at most.
Nearest nearest_condition(const Conditions& c, const SearchOptions& options, const double* x,
                          double* point);

// What a straight motion leads to.
struct Contact {
    double time;  // no condition is met sooner: proven; infinite for none within the horizon
    double rate;  // how fast the first-order distance from a family grows
};

// Contact of x + t velocity with any condition, and the rate for one family; -1 is none.
Contact contact_along(const Conditions& c, std::int64_t family, const double* x,
                      const double* velocity, double horizon);

}  // namespace pinsing
