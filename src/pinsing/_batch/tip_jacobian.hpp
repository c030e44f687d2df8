// The Jacobian of an arm that only turns, in axes that move with its last link: for singular values
// of all six rows, which are the same in whatever axes.
//
// From the tip to the base: W holds the axes of a joint's frame as columns, d is the vector from the
// joint to the tip, both in the last joint's frame. Before joint i comes its placement C_i, and then
// joint i - 1: W <- W R_i^T, d <- d + W t_i, and W is turned back by q[i - 1]. So each column is
// z x d over z, written once, and the first joint's value and placement are of no effect. Nor is the
// last joint's value where the tip lies on its axis, as it does for most arms: then the frame is the
// one before it turns, in which the last two columns are constant.

// W <- W R^T, and d <- d + W t with the new W.
PINSING_INLINE void before_placement(const double* R, const double* t, One* W, One* d) {
    // Turns about x are common: one test serves the block.
    const bool about_x = R[0] == 1.0 && R[1] == 0.0 && R[2] == 0.0 && R[3] == 0.0 && R[6] == 0.0;
    if (about_x) {
        PINSING_UNROLL
        for (int r = 0; r < 3; r++) {
            const One y = W[3 * r + 1], z = W[3 * r + 2];
            W[3 * r + 1] = y * R[4] + z * R[5];
            W[3 * r + 2] = y * R[7] + z * R[8];
        }
    } else {
        PINSING_UNROLL
        for (int r = 0; r < 3; r++) {
            const One x = W[3 * r], y = W[3 * r + 1], z = W[3 * r + 2];
            W[3 * r] = x * R[0] + y * R[1] + z * R[2];
            W[3 * r + 1] = x * R[3] + y * R[4] + z * R[5];
            W[3 * r + 2] = x * R[6] + y * R[7] + z * R[8];
        }
    }
    PINSING_UNROLL
    for (int k = 0; k < 3; k++)
        if (t[k] != 0.0)
            for (int r = 0; r < 3; r++) d[r] += W[3 * r + k] * t[k];
}

// One machine vector at a time: both halves of a block do not fit the registers, and what hides the
// latency of one joint are the sines and cosines of the others.
// q[n] and J[6 n], n >= 2, of one half of a block; row r of joint i at J[2 (r n + i)].
static __attribute__((noinline)) void tip_jacobian_half(const Chain& chain, const One* q, One* J) {
    const int n = chain.n;
    const double* tip = chain.t + 3 * n;
    const bool off = tip[0] != 0.0 || tip[1] != 0.0;  // beside the last joint's axis
    One sine[kMaxColumns], cosine[kMaxColumns];
    for (int i = 1; i < n - !off; i++) sincos(q[2 * i], sine[i], cosine[i]);

    One W[9], d[3];
    for (int k = 0; k < 9; k++) W[k] = spread(k % 4 == 0 ? 1.0 : 0.0);
    for (int r = 0; r < 3; r++) d[r] = spread(tip[r]);
    if (off) {  // in the frame after the last joint's turn, so that its own column is constant
        W[0] = W[4] = cosine[n - 1];
        W[1] = sine[n - 1];
        W[3] = -1.0 * sine[n - 1];
    }
    for (int i = n - 1;; i--) {
        const One x = W[2], y = W[5], z = W[8];
        J[2 * i] = y * d[2] - z * d[1];
        J[2 * (n + i)] = z * d[0] - x * d[2];
        J[2 * (2 * n + i)] = x * d[1] - y * d[0];
        J[2 * (3 * n + i)] = x;
        J[2 * (4 * n + i)] = y;
        J[2 * (5 * n + i)] = z;
        if (i == 0) break;
        before_placement(chain.R + 9 * i, chain.t + 3 * i, W, d);
        if (i == 1) continue;
        const One s = sine[i - 1], c = cosine[i - 1];
        for (int r = 0; r < 3; r++) {
            const One u = W[3 * r], v = W[3 * r + 1];
            W[3 * r] = c * u - s * v;
            W[3 * r + 1] = s * u + c * v;
        }
    }
}

static void tip_jacobian_block(const Chain& chain, const V* q, V* J) {
    for (int half = 0; half < 2; half++)
        tip_jacobian_half(chain, reinterpret_cast<const One*>(q) + half,
                          reinterpret_cast<One*>(J) + half);
}
