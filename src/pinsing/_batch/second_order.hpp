// Second order where one motion is lost, a block at a time: which way the tip can go to second order.
//
// The quantities are those of pinsing/kinematics/refine.py, which says what they mean: with u
// the lost direction, N the self-motions and B_ij = u . dJ_i / dq_j, the form Q = sym(N^T B N). The
// spaces come from one-sided Jacobi rotations, as those of walks do, and so do the eigenvalues of Q.

// What is told of a configuration, in this order.
constexpr int kToldOfSecondOrder = 6;

// Least and greatest eigenvalue of a symmetric matrix Q (p, p), which is destroyed: moved so that none is
// negative, they are its singular values.
static void eigenvalue_ends(V* Q, int p, V& least, V& greatest) {
    V shift = broadcast(0.0), ends[2] = {shift, shift};
    for (int k = 0; k < p * p; k++) shift += vabs(Q[k]);
    for (int a = 0; a < p; a++) Q[a * p + a] += shift;
    orthogonalise(Q, p, p, 0, p);
    for (int side = 0; side < 2; side++) {
        const V* column = Q + side * (p - 1) * p;
        for (int k = 0; k < p; k++) ends[side] += column[k] * column[k];
        ends[side] = vsqrt(ends[side]) - shift;
    }
    greatest = ends[0];
    least = ends[1];
}

// How many singular values are above `zero` of the larger of sigma_1 and `size`; least and greatest
// eigenvalue of Q, and its largest entry; |B N|; and the largest entry of dJ. All task rows, m <= n.
static void second_order_block(const Chain& chain, const Task& task, double zero, double size,
                               const V* q, V* told) {
    const int n = chain.n, m = task.m, p = n - m + 1, column = m + n;
    const V none_at_all = broadcast(0.0), one = broadcast(1.0);
    V J[6 * kWalkJoints], columns[kWalkJoints * (6 + kWalkJoints)], rows[6 * (kWalkJoints + 6)];
    jacobian_block(chain, q, J);
    bordered(task, n, J, columns, rows);
    orthogonalise(columns, n, m, n, column);
    orthogonalise(rows, m, n, m, column);
    V above = none_at_all, first = none_at_all;
    for (int k = 0; k < m; k++) {
        V square = none_at_all;
        for (int i = 0; i < m; i++) square += columns[k * column + i] * columns[k * column + i];
        const V sigma = vsqrt(square);
        if (k == 0) first = vmax(sigma, broadcast(size));
        above += select(sigma > first * zero, one, none_at_all);
    }
    V u[6];
    for (int k = 0; k < 6; k++) u[k] = none_at_all;
    for (int i = 0; i < m; i++) u[task.row[i]] = rows[(m - 1) * column + n + i];
    // Columns of earlier joints carry later ones along: see derivative_along in walk.hpp.
    V largest = none_at_all, v_u[3 * kWalkJoints], w_u[3 * kWalkJoints], B[kWalkJoints * kWalkJoints];
    for (int j = 0; j < n; j++) {
        V v[3], w[3];
        for (int r = 0; r < 3; r++) {
            v[r] = J[r * n + j];
            w[r] = J[(3 + r) * n + j];
            v_u[3 * j + r] = w_u[3 * j + r] = none_at_all;
        }
        cross_into(v, u, v_u + 3 * j);
        cross_into(w, u + 3, w_u + 3 * j);
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) {
            const int turning = j <= i ? j : i, carried = j <= i ? i : j;
            V sum = none_at_all, w[3], v[3], slope[6];
            for (int r = 0; r < 3; r++) {
                w[r] = J[(3 + r) * n + turning];
                v[r] = J[r * n + carried];
                const V along = v_u[3 * carried + r];
                sum += w[r] * (j <= i ? along + w_u[3 * i + r] : along);
                slope[r] = slope[3 + r] = none_at_all;
            }
            B[i * n + j] = sum;
            cross_into(w, v, slope);
            if (j <= i) {
                for (int r = 0; r < 3; r++) v[r] = J[(3 + r) * n + i];
                cross_into(w, v, slope + 3);
            }
            for (int k = 0; k < m; k++) largest = vmax(largest, vabs(slope[task.row[k]]));
        }
    }
    V BN[kWalkJoints * kWalkJoints], Q[kWalkJoints * kWalkJoints];
    V reached = none_at_all;
    for (int i = 0; i < n; i++) {
        for (int b = 0; b < p; b++) {
            const V* still = columns + (m - 1 + b) * column + m;
            V sum = none_at_all;
            for (int j = 0; j < n; j++) sum += B[i * n + j] * still[j];
            BN[i * p + b] = sum;
            reached += sum * sum;
        }
    }
    for (int a = 0; a < p; a++) {
        const V* still = columns + (m - 1 + a) * column + m;
        for (int b = 0; b < p; b++) {
            V sum = none_at_all;
            for (int i = 0; i < n; i++) sum += still[i] * BN[i * p + b];
            Q[a * p + b] = sum;
        }
    }
    V entry = none_at_all;
    for (int a = 0; a < p; a++) {
        for (int b = 0; b <= a; b++) {
            const V mean = 0.5 * (Q[a * p + b] + Q[b * p + a]);
            Q[a * p + b] = Q[b * p + a] = mean;
            entry = vmax(entry, vabs(mean));
        }
    }
    told[0] = above;
    eigenvalue_ends(Q, p, told[1], told[2]);
    told[3] = entry;
    told[4] = vsqrt(reached);
    told[5] = largest;
}
