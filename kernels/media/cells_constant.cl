/* Cells of constant extinction. */
typedef struct {
    real sigma;
} Cell;

static real cell_depth(const Cell cell, const real length) { return cell.sigma * length; }

static real cell_distance(const Cell cell, const real depth, const real length) { return depth / cell.sigma; }
