// What Flamenco's manager gives to a job type, as version 3.9 was seen to do: the globals `author`, `frameChunker`, `frameCount`,
// `formatTimestampLocal` and `print`, and a job with settings and `addTask`. It compiles one job and prints its tasks.
//
//     node flamenco_manager.js SCRIPT < {"settings": {…}}
//         prints {"label", "keys", "defaults", "evals", "tasks": [[name, type, [[command, parameters, steps]…]]…]}
//
//     node flamenco_manager.js SCRIPT --older       a manager before 3.8, which has no steps
//
// A task, a command and a job take no other calls. As the manager does, it lets settings pass that the job type does not declare, or that it
// requires and the job lacks; unlike the manager, which reads them without a word, it refuses a declaration that Flamenco's schema has not.

const fs = require("fs"), vm = require("vm");

const [script, option] = process.argv.slice(2);

function whole(text, range) {
    if (!/^\s*[+-]?\d+\s*$/.test(text)) throw new Error(`invalid range "${range}": ${text}`);
    return Number(text);
}

// Frames in their order, each once, whatever the order and the overlaps of the text. `..` is a hyphen.
function listed(range) {
    const found = new Set();
    if (!range.trim()) throw new Error(`invalid range "": empty range`);
    for (const part of range.trim().replaceAll("..", "-").split(",")) {
        const ends = part.split("-");
        if (ends.length > 2) throw new Error(`invalid range "${range}": ${part}`);
        const first = whole(ends[0], range), last = whole(ends.at(-1), range);
        for (let frame = first; frame <= last; frame++) found.add(frame);
    }
    if (!found.size) throw new Error(`invalid range "${range}": empty range`);
    return [...found].sort((a, b) => a - b);
}

// Runs of three frames and more are written with a hyphen, others with commas.
const written = (frames) => {
    const runs = [];
    for (const frame of frames) {
        if (runs.length && runs.at(-1)[1] === frame - 1) runs.at(-1)[1] = frame;
        else runs.push([frame, frame]);
    }
    return runs.map(([first, last]) => (first === last ? `${first}` : `${first}${last - first > 1 ? "-" : ","}${last}`)).join(",");
};

// The time of a job is the manager's own kind of value, on which a script can call nothing.
const created = Object.freeze({});

const globals = {
    print: () => {},
    author: {
        Task: (name, type) => ({ name, type, commands: [], addCommand(command) { this.commands.push(command); } }),
        Command: (name, parameters, steps) => ({ name, parameters, steps: option === "--older" ? null : steps ?? 0 }),
    },
    frameChunker(range, size) {
        // What is no number is 0, and a part of a frame is none.
        const most = Math.trunc(Number(size) || 0);
        if (most < 1) throw new Error(`invalid chunk size, must be positive number: ${most}`);
        const frames = listed(range), chunks = [];
        for (let at = 0; at < frames.length; at += most) chunks.push(written(frames.slice(at, at + most)));
        return chunks;
    },
    formatTimestampLocal(date) {
        if (date !== created) throw new Error("formatTimestampLocal: no time of the manager's");
        return "2026-11-28_101500";
    },
};
if (option !== "--older") globals.frameCount = (range) => listed(range).length;

const SCHEMA = {
    type: ["string", "int32", "float", "bool"],
    subtype: ["file_path", "dir_path", "file_name", "hashed_file_path"],
    visible: ["visible", "hidden", "submission", "web"],
};
const FIELDS = [...Object.keys(SCHEMA), "key", "label", "choices", "propargs", "description", "default", "eval", "evalInfo", "required", "editable"];

const context = vm.createContext(globals);
// The manager compiles scripts as strict ones.
vm.runInContext('"use strict";' + fs.readFileSync(script, "utf-8"), context);
const type = vm.runInContext("JOB_TYPE", context), tasks = [];
const { settings } = JSON.parse(fs.readFileSync(0, "utf-8"));
for (const one of type.settings) {
    for (const field of Object.keys(one)) if (!FIELDS.includes(field)) throw new Error(`${one.key}: no field ${field}`);
    for (const [field, values] of Object.entries(SCHEMA)) {
        if (field in one && !values.includes(one[field])) throw new Error(`${one.key}: ${field} ${one[field]}`);
    }
}
context.job = { settings, created, addTask: (task) => tasks.push(task) };
vm.runInContext("compileJob(job)", context);
console.log(JSON.stringify({
    label: type.label,
    keys: type.settings.map((one) => one.key),
    defaults: Object.fromEntries(type.settings.filter((one) => "default" in one).map((one) => [one.key, one.default])),
    evals: Object.fromEntries(type.settings.filter((one) => "eval" in one).map((one) => [one.key, one.eval])),
    tasks: tasks.map((task) => [task.name, task.type, task.commands.map((command) => [command.name, command.parameters, command.steps])]),
}));
