// What Flamenco's manager gives to a job type, after its documentation and the job types that it brings (version 3): the globals `author`,
// `frameChunker`, `formatTimestampLocal` and `print`, and a job with settings and `addTask`. It compiles one job and prints its tasks.
//
//     node flamenco_manager.js SCRIPT < {"settings": {…}}      prints {"label", "keys", "defaults", "tasks": [[name, type, [[command, parameters]…]]…]}
//
// A task, a command and a job take no other calls. A setting that the job type does not declare is refused, as the manager does.

const fs = require("fs"), vm = require("vm");

const listed = (text) => text.split(",").flatMap((part) => {
    const [first, last] = part.trim().split("-").map(Number);
    return Array.from({ length: (last ?? first) - first + 1 }, (_, step) => first + step);
});

// Runs of frames are written with a hyphen, others with commas.
const written = (frames) => {
    const runs = [];
    for (const frame of frames) {
        if (runs.length && runs.at(-1)[1] === frame - 1) runs.at(-1)[1] = frame;
        else runs.push([frame, frame]);
    }
    return runs.map(([first, last]) => (first === last ? `${first}` : `${first}-${last}`)).join(",");
};

const globals = {
    print: () => {},
    author: {
        Task: (name, type) => ({ name, type, commands: [], addCommand(command) { this.commands.push(command); } }),
        Command: (name, parameters) => ({ name, parameters }),
    },
    frameChunker(range, size) {
        const frames = listed(range), chunks = [];
        for (let at = 0; at < frames.length; at += size) chunks.push(written(frames.slice(at, at + size)));
        return chunks;
    },
    formatTimestampLocal: (date) => date.toISOString().slice(0, 19).replace("T", "_").replaceAll(":", ""),
};

const context = vm.createContext(globals);
vm.runInContext(fs.readFileSync(process.argv[2], "utf-8"), context);
const type = vm.runInContext("JOB_TYPE", context), tasks = [];
const { settings } = JSON.parse(fs.readFileSync(0, "utf-8"));
const keys = type.settings.map((one) => one.key);
for (const key of Object.keys(settings)) if (!keys.includes(key)) throw new Error(`${key}: no setting of ${type.label}`);
for (const one of type.settings) {
    // Flamenco knows these fields, and evaluates an expression in Blender before it submits a job.
    const known = ["key", "type", "subtype", "choices", "propargs", "description", "default", "eval", "evalInfo", "visible", "required", "editable"];
    for (const field of Object.keys(one)) if (!known.includes(field)) throw new Error(`${one.key}: no field ${field}`);
}
context.job = { settings, created: new Date("2026-11-28T10:15:00Z"), addTask: (task) => tasks.push(task) };
vm.runInContext("compileJob(job)", context);
console.log(JSON.stringify({
    label: type.label,
    keys,
    defaults: Object.fromEntries(type.settings.filter((one) => "default" in one).map((one) => [one.key, one.default])),
    evals: Object.fromEntries(type.settings.filter((one) => "eval" in one).map((one) => [one.key, one.eval])),
    tasks: tasks.map((task) => [task.name, task.type, task.commands.map((command) => [command.name, command.parameters])]),
}));
