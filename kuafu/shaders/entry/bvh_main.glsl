// SPDX-License-Identifier: Apache-2.0
// Main of the kernels that trace a queue. Theirs are begin(i), which begins a walk; any_hit(), whether the first hit found ends it; and answer(i) at its end, which
// returns whether it has begun another walk for ray i.
void main() {
  uint i = queue_ray_index();
  if (i >= queue_ray_count()) return;
  begin(i);
  do {
    while (bvh_current != bvh_done) bvh_step(queue_world(), any_hit());
  } while (answer(i));
}
