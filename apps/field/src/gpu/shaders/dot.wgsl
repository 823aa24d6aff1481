// The products of a workgroup become one, always in the same order.

@group(0) @binding(3) var<storage, read_write> products: array<f32>;
var<workgroup> lanes: array<f32, 256>;

fn finish(product: f32, local: u32, group: u32) {
    lanes[local] = product;
    for (var half = 128u; half > 0u; half >>= 1u) {
        workgroupBarrier();
        if local < half {
            lanes[local] += lanes[local + half];
        }
    }
    if local == 0u {
        products[group] = lanes[0];
    }
}
