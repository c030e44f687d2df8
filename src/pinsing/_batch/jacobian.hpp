// The Jacobian of a flattened chain, included inside a namespace: for a block of configurations, or for one.
//
// q[n] -> J[6 * n], row r of joint i at J[r * n + i]: translation rows first, of the tip point, in
// the axes of the base (LOCAL_WORLD_ALIGNED): z x (tip - origin) over z for a revolute joint, z
// over zero for a prismatic one. And where the tip is: its position, and the axes that its frame is placed in.
template <class T>
struct Tip {
    T R[9], p[3];
};
template <class T>
static __attribute__((noinline)) void jacobian_block(const Chain& chain, const T* q, T* J,
                                                     Tip<T>* tip = nullptr) {
    const int n = chain.n;
    T R[9], p[3];
    for (int k = 0; k < 9; k++) R[k] = broadcast(chain.R[k]);
    for (int k = 0; k < 3; k++) p[k] = broadcast(chain.t[k]);
    for (int i = 0; i < n; i++) {
        if (i > 0) {
            const double* C = chain.R + 9 * i;
            const double* t = chain.t + 3 * i;
            // Zeros of t, and turns about x, are common: one test serves the block.
            const bool about_x = C[0] == 1.0 && C[1] == 0.0 && C[2] == 0.0 && C[3] == 0.0 &&
                                 C[6] == 0.0;
            for (int k = 0; k < 3; k++)
                if (t[k] != 0.0)
                    for (int r = 0; r < 3; r++) p[r] += R[3 * r + k] * t[k];
            for (int r = 0; r < 3; r++) {
                T x = R[3 * r], y = R[3 * r + 1], z = R[3 * r + 2];
                if (!about_x) R[3 * r] = x * C[0] + y * C[3] + z * C[6];
                R[3 * r + 1] = (about_x ? y * C[4] : x * C[1] + y * C[4]) + z * C[7];
                R[3 * r + 2] = (about_x ? y * C[5] : x * C[2] + y * C[5]) + z * C[8];
            }
        }
        for (int r = 0; r < 3; r++) {
            J[(3 + r) * n + i] = R[3 * r + 2];
            J[r * n + i] = p[r];
        }
        if (chain.prismatic[i]) {
            for (int r = 0; r < 3; r++) p[r] += R[3 * r + 2] * q[i];
        } else {
            T s, c;
            sincos(q[i], s, c);
            for (int r = 0; r < 3; r++) {
                T x = R[3 * r], y = R[3 * r + 1];
                R[3 * r] = c * x + s * y;
                R[3 * r + 1] = c * y - s * x;
            }
        }
    }
    const double* t = chain.t + 3 * n;
    for (int r = 0; r < 3; r++) p[r] += R[3 * r] * t[0] + R[3 * r + 1] * t[1] + R[3 * r + 2] * t[2];
    if (tip != nullptr) *tip = {{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}, {p[0], p[1], p[2]}};
    for (int i = 0; i < n; i++) {
        T z0 = J[3 * n + i], z1 = J[4 * n + i], z2 = J[5 * n + i];
        if (chain.prismatic[i]) {
            J[i] = z0, J[n + i] = z1, J[2 * n + i] = z2;
            J[3 * n + i] = J[4 * n + i] = J[5 * n + i] = broadcast(0.0);
        } else {
            T d0 = p[0] - J[i], d1 = p[1] - J[n + i], d2 = p[2] - J[2 * n + i];
            J[i] = z1 * d2 - z2 * d1;
            J[n + i] = z2 * d0 - z0 * d2;
            J[2 * n + i] = z0 * d1 - z1 * d0;
        }
    }
}
