import{ak as p,al as t,am as c}from"./index-5mwIUBnZ.js";function l(n,s,...e){var r=new c(n);p(()=>{const a=s()??null;r.ensure(a,a&&(o=>a(o,...e)))},t)}export{l as s};
