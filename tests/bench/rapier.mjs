// A scene in Rapier (SIMD build, WASM): reads JSON from the standard input, writes the time of each step, ms, the poses at frames, and the last velocities.
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

const RAPIER = createRequire(process.argv[2] + "/")("@dimforge/rapier3d-simd-compat");
await RAPIER.init();
const scene = JSON.parse(readFileSync(0, "utf8"));
const vector = ([x, y, z]) => ({ x, y, z });
const turn = ([w, x, y, z]) => ({ w, x, y, z });

function shape(part) {
    if (part.kind === "sphere") return RAPIER.ColliderDesc.ball(part.radius);
    if (part.kind === "box") return RAPIER.ColliderDesc.cuboid(...part.half);
    return RAPIER.ColliderDesc.convexHull(new Float32Array(part.vertices.flat()));
}

const world = new RAPIER.World(vector(scene.gravity));
world.timestep = scene.step;
world.integrationParameters.numSolverIterations = scene.iterations;
const bodies = [];
for (const body of scene.bodies) {
    const desc = (body.dynamic ? RAPIER.RigidBodyDesc.dynamic() : RAPIER.RigidBodyDesc.fixed())
        .setTranslation(...body.position).setRotation(turn(body.orientation)).setCanSleep(scene.sleeping);
    if (body.dynamic) {
        desc.setLinvel(...body.velocity).setAngvel(vector(body.spin));
        desc.setAdditionalMassProperties(body.mass, vector(body.centre), vector(body.moments), turn(body.axes));
    }
    const added = world.createRigidBody(desc);
    for (const part of body.parts) {
        const collider = shape(part).setTranslation(...part.position).setRotation(turn(part.orientation)).setDensity(0.0)
            .setFriction(body.friction).setRestitution(body.restitution);
        world.createCollider(collider, added);
    }
    bodies.push(added);
}
const pose = (body) => {
    const x = body.translation(), q = body.rotation();
    return [x.x, x.y, x.z, q.w, q.x, q.y, q.z];
};
const times = [], poses = [];
for (let k = 0; k < scene.steps; k++) {
    const start = performance.now();
    world.step();
    times.push(performance.now() - start);
    if ((scene.steps - 1 - k) % scene.each === 0) poses.push(bodies.map(pose));
}
const speeds = bodies.map((b) => {
    const v = b.linvel(), w = b.angvel();
    return [v.x, v.y, v.z, w.x, w.y, w.z];
});
process.stdout.write(JSON.stringify({ times, poses, speeds }));
